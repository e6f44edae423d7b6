//! Strict JSON: reads a text and refuses objects with duplicate fields, of which one value would be
//! lost silently.
//!
//! A byte-order mark, which editors put at the start of a file, is ignored.

use crate::input;
use crate::output::text::clipped;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;
use std::path::Path;

/// Reads a file like [`parse`].
pub fn read(path: &Path) -> Result<Value, String> {
    parse(&input::read_text(path).map_err(|e| format!("cannot be read: {e}"))?)
}

/// Reads a text, with or without a byte-order mark. The error is the second half of a sentence that
/// begins with the file's name, and has line and column.
pub fn parse(text: &str) -> Result<Value, String> {
    let mut deserializer = serde_json::Deserializer::from_str(input::without_mark(text));
    let value = Unique
        .deserialize(&mut deserializer)
        .and_then(|value| deserializer.end().map(|()| value));
    value.map_err(|e| {
        if e.is_data() {
            e.to_string()
        } else {
            format!("not JSON: {e}")
        }
    })
}

/// A value without duplicate fields.
#[derive(Clone, Copy)]
struct Unique;

impl<'de> DeserializeSeed<'de> for Unique {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Unique {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Number::from_f64(value).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_string<E>(self, value: String) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut all = Vec::new();
        while let Some(item) = items.next_element_seed(Unique)? {
            all.push(item);
        }
        Ok(Value::Array(all))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<Value, A::Error> {
        let mut all = Map::new();
        while let Some(name) = fields.next_key::<String>()? {
            if all.contains_key(&name) {
                return Err(A::Error::custom(format_args!(
                    "the field `{}` is there twice",
                    clipped(&name)
                )));
            }
            all.insert(name, fields.next_value_seed(Unique)?);
        }
        Ok(Value::Object(all))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_what_serde_json_reads() {
        let text = r#"{"b": [1, -2, 0.1, 1e300, -0.0, 18446744073709551616, "é\n", true, null, {}], "a": {"b": 1, "a": 2}}"#;
        let value = parse(text).unwrap();
        assert_eq!(
            value.to_string(),
            serde_json::from_str::<Value>(text).unwrap().to_string()
        );
    }

    #[test]
    fn a_byte_order_mark_is_ignored() {
        let text = "{\"é\": [1, \"\u{1f600}\"]}";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.json");
        let wide = |order: fn(u16) -> [u8; 2]| {
            format!("\u{feff}{text}")
                .encode_utf16()
                .flat_map(order)
                .collect::<Vec<u8>>()
        };
        let plain = text.as_bytes().to_vec();
        for bytes in [
            plain,
            format!("\u{feff}{text}").into_bytes(),
            wide(u16::to_le_bytes),
            wide(u16::to_be_bytes),
        ] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(
                read(&path).unwrap(),
                serde_json::from_str::<Value>(text).unwrap()
            );
        }
        // A second mark is an error; truncated text and other encodings are reported.
        assert!(
            parse("\u{feff}\u{feff}1")
                .unwrap_err()
                .starts_with("not JSON")
        );
        for bytes in [
            &[0xff, 0xfe, b'1'][..],
            &[0xff, 0xfe, 0x00, 0xd8],
            &[b'"', 0xe9, b'"'],
        ] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(
                read(&path).unwrap_err(),
                "cannot be read: it is not UTF-8 text"
            );
        }
    }

    #[test]
    fn a_duplicate_field_is_refused_with_its_place() {
        let sentence = parse("{\"a\": 1,\n \"b\": {\"c\": 1, \"c\": 1}}").unwrap_err();
        assert!(
            sentence.starts_with("the field `c` is there twice at line 2 column "),
            "{sentence}"
        );
        assert!(
            parse("{\"a\": 1} 2")
                .unwrap_err()
                .starts_with("not JSON: trailing characters at line 1")
        );
        assert!(parse("{").unwrap_err().starts_with("not JSON: EOF"));
        assert!(
            parse(&"[".repeat(100_000))
                .unwrap_err()
                .starts_with("not JSON: recursion limit")
        );
    }
}
