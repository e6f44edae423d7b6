//! Http: one request and one response per connection, with the minimum of HTTP/1.1 (RFC 9112) that
//! a browser needs; everything else is refused.
//!
//! ```text
//! bytes ─► [head: at most 8 KiB, in 5 s] ─► [GET or HEAD, target, Host] ─► Request ─► handler ─► Response ─► bytes
//!                      └──────────────────────────┴─► status only
//! ```
//! No body is ever read. Laws: `no_bytes_make_the_reader_panic`,
//! `a_request_is_read_whatever_its_parts`.

use std::borrow::Cow;
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

/// Greatest number of bytes of a head.
pub const MOST_HEAD_BYTES: usize = 8 * 1024;
/// Time limit for a head to arrive.
pub const HEAD_TIME: Duration = Duration::from_secs(5);

/// Status of a refused request.
pub type Refusal = u16;

/// A parsed request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Parts of the path between its slashes, unchanged: names of this server need no decoding.
    pub path: Vec<String>,
    /// What follows the `?`, as pairs.
    pub query: Vec<(String, String)>,
    /// The field `Host`.
    pub host: String,
    /// The response has no body.
    pub head_only: bool,
}

impl Request {
    /// An integer of the query.
    pub fn number(&self, name: &str) -> Option<usize> {
        self.query
            .iter()
            .find(|(other, _)| other == name)
            .and_then(|(_, value)| value.parse().ok())
    }
}

/// A response.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Response {
    /// For example 200.
    pub status: u16,
    /// Media type of the body.
    pub kind: &'static str,
    /// The whole body.
    pub body: Cow<'static, [u8]>,
}

impl Response {
    /// A response that contains only its status.
    pub fn refusal(status: Refusal) -> Self {
        Response {
            status,
            kind: "text/plain; charset=utf-8",
            body: Cow::Owned(format!("{status} {}\n", reason(status)).into_bytes()),
        }
    }

    /// A response with one sentence about a failure.
    pub fn sentence(status: u16, sentence: &str) -> Self {
        Response {
            status,
            kind: "text/plain; charset=utf-8",
            body: Cow::Owned(sentence.as_bytes().to_vec()),
        }
    }

    /// A response with JSON.
    pub fn json(text: String) -> Self {
        Response {
            status: 200,
            kind: "application/json",
            body: Cow::Owned(text.into_bytes()),
        }
    }

    /// Writes the response. The page may load resources only from this server, may not be framed,
    /// and is not cached by the browser.
    ///
    /// # Errors
    /// Errors of the connection.
    pub fn write(&self, to: &mut impl Write, head_only: bool) -> std::io::Result<()> {
        let Response { status, kind, body } = self;
        let head = format!(
            "HTTP/1.1 {status} {}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
             Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
             img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
             Cross-Origin-Resource-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\r\n",
            reason(*status),
            body.len()
        );
        to.write_all(head.as_bytes())?;
        if !head_only {
            to.write_all(body)?;
        }
        to.flush()
    }
}

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        413 => "Content Too Large",
        421 => "Misdirected Request",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        505 => "HTTP Version Not Supported",
        _ => "Error",
    }
}

/// Reads a head up to its empty line; before each read, `set_time` is called with the time that is
/// left.
///
/// # Errors
/// 400 if the client closes early, 408 if it is too slow, 431 if the head is too long.
pub fn read_head<R: Read>(
    from: &mut R,
    set_time: impl Fn(&R, Duration),
) -> Result<Vec<u8>, Refusal> {
    let end = Instant::now() + HEAD_TIME;
    let mut head = Vec::new();
    let mut part = [0; 1024];
    loop {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(408);
        }
        set_time(from, left);
        match from.read(&mut part) {
            Ok(0) => return Err(400),
            Ok(length) => head.extend_from_slice(&part[..length]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return Err(408);
            }
            Err(_) => return Err(400),
        }
        if let Some(end) = head.windows(4).position(|four| four == b"\r\n\r\n") {
            head.truncate(end + 2);
            return if head.len() > MOST_HEAD_BYTES {
                Err(431)
            } else {
                Ok(head)
            };
        }
        if head.len() > MOST_HEAD_BYTES {
            return Err(431);
        }
    }
}

/// Parses a head, whose lines all end in CR LF.
///
/// # Errors
/// 400 if it is malformed, 405 for a method other than GET and HEAD, 413 if a body would follow,
/// 505 for another version of HTTP.
pub fn parse(head: &[u8]) -> Result<Request, Refusal> {
    let text = std::str::from_utf8(head).map_err(|_| 400_u16)?;
    let mut lines = text.strip_suffix("\r\n").ok_or(400_u16)?.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(target), Some(version), None) =
        (words.next(), words.next(), words.next(), words.next())
    else {
        return Err(400);
    };
    if method.is_empty()
        || !method.bytes().all(|byte| byte.is_ascii_uppercase())
        || !target.starts_with('/')
    {
        return Err(400);
    }
    match version {
        "HTTP/1.1" | "HTTP/1.0" => {}
        other => return Err(if other.starts_with("HTTP/") { 505 } else { 400 }),
    }
    let mut host = None;
    let mut has_body = false;
    for line in lines {
        let (name, value) = line.split_once(':').ok_or(400_u16)?;
        if name.is_empty()
            || !name
                .bytes()
                .all(|byte| byte.is_ascii_alphanumeric() || b"!#$%&'*+-.^_`|~".contains(&byte))
        {
            return Err(400);
        }
        let value = value.trim_matches([' ', '\t']);
        match name.to_ascii_lowercase().as_str() {
            // An intermediary could use either of two `Host` fields.
            "host" if host.is_some() => return Err(400),
            "host" => host = Some(value.to_owned()),
            "content-length" => has_body |= value != "0",
            "transfer-encoding" => has_body = true,
            _ => {}
        }
    }
    let head_only = match method {
        "GET" => false,
        "HEAD" => true,
        _ => return Err(405),
    };
    if has_body {
        return Err(413);
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    Ok(Request {
        path: path[1..].split('/').map(str::to_owned).collect(),
        query: pairs
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
            .collect(),
        host: host.ok_or(400_u16)?,
        head_only,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn refusal(text: &str) -> Refusal {
        parse(text.as_bytes()).unwrap_err()
    }

    #[test]
    fn a_request_is_read() {
        let request =
            parse(b"GET /a/b.png?x=3&y=04 HTTP/1.1\r\nhost:  127.0.0.1:80 \r\nAccept: */*\r\n")
                .unwrap();
        assert_eq!(
            (request.path.clone(), request.host.as_str()),
            (vec!["a".to_owned(), "b.png".to_owned()], "127.0.0.1:80")
        );
        assert_eq!(
            (
                request.number("x"),
                request.number("y"),
                request.number("z")
            ),
            (Some(3), Some(4), None)
        );
        assert!(parse(b"HEAD / HTTP/1.0\r\nHost: a\r\n").unwrap().head_only);
    }

    #[test]
    fn malformed_requests_are_refused() {
        for (head, status) in [
            ("", 400),
            ("GET / HTTP/1.1\r\n", 400),
            ("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n", 400),
            ("GET  / HTTP/1.1\r\nHost: a\r\n", 400),
            ("GET http://a/ HTTP/1.1\r\nHost: a\r\n", 400),
            ("GET / HTTP/1.1\r\nHost: a\r\n folded\r\n", 400),
            ("GET / HTTP/1.1\r\nHost : a\r\n", 400),
            ("get / HTTP/1.1\r\nHost: a\r\n", 400),
            ("GET / HTTP/2\r\nHost: a\r\n", 505),
            ("GET / SPDY\r\nHost: a\r\n", 400),
            ("POST / HTTP/1.1\r\nHost: a\r\n", 405),
            (
                "GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 1000000000\r\n",
                413,
            ),
            (
                "GET / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n",
                413,
            ),
        ] {
            assert_eq!(refusal(head), status, "{head:?}");
        }
    }

    #[test]
    fn a_head_ends_at_its_empty_line_or_is_too_long() {
        let read = |mut bytes: &[u8]| read_head(&mut bytes, |_, _| ());
        assert_eq!(
            read(b"GET / HTTP/1.1\r\nHost: a\r\n\r\nbody"),
            Ok(b"GET / HTTP/1.1\r\nHost: a\r\n".to_vec())
        );
        assert_eq!(read(b"GET / HTTP/1.1\r\nHost: a\r\n"), Err(400));
        assert_eq!(read(&[b'a'; 3 * MOST_HEAD_BYTES]), Err(431));
        let long = format!(
            "GET / HTTP/1.1\r\nHost: {}\r\n\r\n",
            "a".repeat(MOST_HEAD_BYTES)
        );
        assert_eq!(read(long.as_bytes()), Err(431));
    }

    proptest! {
        #[test]
        fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), most in 1_usize..9) {
            /// Gives a few bytes at a time.
            struct Slow<'a>(&'a [u8], usize);
            impl Read for Slow<'_> {
                fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
                    let length = self.1.min(self.0.len()).min(to.len());
                    let (now, rest) = self.0.split_at(length);
                    to[..length].copy_from_slice(now);
                    self.0 = rest;
                    Ok(length)
                }
            }
            let _ = parse(&bytes);
            let _ = read_head(&mut Slow(&bytes, most), |_, _| ()).map(|head| parse(&head));
        }

        #[test]
        fn a_request_is_read_whatever_its_parts(
            parts in prop::collection::vec("[a-z0-9.%_-]{0,9}", 1..5),
            x in any::<u16>(),
            host in "[a-z0-9.:]{1,20}",
            other in "[ -~]{0,40}",
        ) {
            let path = parts.join("/");
            let head = format!("GET /{path}?x={x} HTTP/1.1\r\nX-Other: {other}\r\nHost: {host}\r\n");
            let request = parse(head.as_bytes()).unwrap();
            prop_assert_eq!((&request.path, request.number("x"), &request.host), (&parts, Some(usize::from(x)), &host));
        }
    }
}
