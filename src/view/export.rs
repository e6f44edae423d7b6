//! Export: the same page as one file that needs neither server nor network, without data that is
//! computed on demand.
//!
//! Law (tests/view.rs): `an_export_names_nothing_outside_of_itself`.

use super::View;
use super::assets;
use crate::error::{Error, Result};
use crate::output::files::write_beside;
use crate::output::text::json_in_html;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Map, Value, json};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

/// Greatest number of pictures in a page: a browser keeps all of them in memory.
const MOST_PICTURES: usize = 512;

/// Bytes of a page that contain its title.
const HEAD_BYTES: u64 = 1024;

/// Writes a folder's page into a file; only earlier exports are overwritten.
///
/// # Errors
/// [`Error::Input`] if the path is unusable, [`Error::Job`] if the file cannot be written.
pub fn write(view: &View, path: &Path) -> Result<()> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let input_error = |what: &str| {
        Err(Error::input(format!(
            "--export {}: cannot be written: {what}",
            path.display()
        )))
    };
    if folder.is_some_and(|folder| !folder.is_dir()) {
        return input_error("there is no such folder");
    }
    if path.is_dir() {
        return input_error("it is a folder, and a file is needed");
    }
    if path.exists() && !is_page(path) {
        return input_error("it already exists and is not a page that --export wrote");
    }
    let page = html(view)?;
    write_beside(path, |file| {
        file.write_all(page.as_bytes()).map_err(|e| e.to_string())
    })
}

/// Whether a file is empty or begins like an exported page.
fn is_page(path: &Path) -> bool {
    let mut begins = Vec::new();
    let read = path.is_file()
        && File::open(path)
            .is_ok_and(|file| file.take(HEAD_BYTES).read_to_end(&mut begins).is_ok());
    read && (begins.is_empty() || String::from_utf8_lossy(&begins).contains(assets::TITLE))
}

/// The page, with its pictures as data URLs.
///
/// # Errors
/// [`Error::Input`] if a picture has changed.
pub fn html(view: &View) -> Result<String> {
    let folder = view.folder();
    let mut contents = folder.contents.clone();
    let names = folder.pictures();
    if names.len() > MOST_PICTURES {
        return Err(Error::input(format!(
            "{}: has {} pictures; an exported page has at most {MOST_PICTURES}",
            folder.name(),
            names.len()
        )));
    }
    let pictures = names.into_iter().map(|name| {
        let bytes = folder
            .file(&name)
            .map_err(|(_, sentence)| Error::input(sentence))?;
        let url = Value::from(format!("data:image/png;base64,{}", STANDARD.encode(bytes)));
        Ok((name, url))
    });
    contents["files"] = Value::Object(pictures.collect::<Result<Map<_, _>>>()?);
    if contents["tiles"] == true {
        let bytes = folder
            .file("tiles.csv")
            .map_err(|(_, sentence)| Error::input(sentence))?;
        contents["texts"] = json!({"tiles.csv": String::from_utf8_lossy(&bytes)});
    }
    hide_paths(&mut contents);
    Ok(assets::page_with(&json_in_html(&contents)))
}

/// Removes folders of this computer from data for other readers: only the file name of a scene is
/// kept.
fn hide_paths(contents: &mut Value) {
    if let Some(host) = contents
        .pointer_mut("/run/report/host")
        .and_then(Value::as_object_mut)
    {
        host.remove("scene_file");
    }
    if let Some(scene) = contents.pointer_mut("/run/scene")
        && let Some(name) = scene
            .as_str()
            .and_then(|path| path.rsplit(['/', '\\']).next())
    {
        *scene = Value::from(name);
    }
}
