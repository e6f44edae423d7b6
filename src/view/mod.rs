//! View: shows a folder in a browser: the frame and each pixel's trace, the machine, rows of a
//! sweep.
//!
//! ```text
//! DIR ─► folder ─┬─► server ─► answers: page, assets, files, pixels, maps, traces ─► browser
//!                └─► export ─► one HTML file without data that is computed on demand
//! redraw ────────────► pixels, maps, traces (drawn on the first request)
//! assets/            HTML, CSS and JavaScript as they are; uPlot draws charts
//! ```
//! The page is plain HTML, CSS and JavaScript and requests only data from this program. Charts with
//! axes use uPlot (1.6.32, 51 KB, MIT): it draws 10,000 points in a few milliseconds on a canvas,
//! and Observable Plot and Vega-Lite have ten times as many bytes.
//!
//! Laws: tests/view.rs (the server), tests/browser.rs (the page).

pub mod assets;
pub mod export;
pub mod folder;
pub mod http;
pub mod redraw;
pub mod server;

use crate::error::Result;
use folder::ResultFolder;
use http::{Request, Response};
use redraw::Redraw;
use server::Handler;
use std::borrow::Cow;
use std::ffi::OsString;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

/// A folder, and data that is computed from it on demand.
#[derive(Debug)]
pub struct View {
    folder: ResultFolder,
    /// The scene's path, if it was moved.
    scene: Option<OsString>,
    /// Drawn on the first request; or the reason why it cannot be drawn.
    redraw: OnceLock<std::result::Result<Redraw, String>>,
    /// One pixel trace at a time: each draws a frame, on all threads.
    story: Mutex<()>,
}

impl View {
    /// Reads a folder.
    ///
    /// # Errors
    /// As [`ResultFolder::read`].
    pub fn new(folder: &Path, scene: Option<OsString>) -> Result<Self> {
        Ok(View {
            folder: ResultFolder::read(folder)?,
            scene,
            redraw: OnceLock::new(),
            story: Mutex::new(()),
        })
    }

    /// The folder.
    pub fn folder(&self) -> &ResultFolder {
        &self.folder
    }

    fn redraw(&self) -> std::result::Result<&Redraw, Response> {
        let run = self.folder.run.as_ref().ok_or(Response::refusal(404))?;
        let drawn = self.redraw.get_or_init(|| {
            Redraw::new(run, self.scene.as_deref()).map_err(|error| error.to_string())
        });
        drawn
            .as_ref()
            .map_err(|sentence| Response::sentence(503, sentence))
    }

    fn computed(&self, name: &str, request: &Request) -> std::result::Result<Response, Response> {
        if !["drawn", "pixel", "story"].contains(&name) {
            return Err(Response::refusal(404));
        }
        let redraw = self.redraw()?;
        let pixel = || {
            request
                .number("x")
                .zip(request.number("y"))
                .map(|(x, y)| [x, y])
                .ok_or(Response::refusal(400))
        };
        let json = |value: &serde_json::Value| Response::json(value.to_string());
        match name {
            "drawn" => Ok(json(&serde_json::json!({"maps": redraw::MAPS}))),
            "pixel" => Ok(json(&redraw.pixel(pixel()?).ok_or(Response::refusal(404))?)),
            _ => {
                let pixel = pixel()?;
                let _one = self.story.lock().unwrap_or_else(PoisonError::into_inner);
                let story = redraw
                    .story(pixel)
                    .map_err(|error| Response::sentence(404, &error.to_string()))?;
                Ok(json(&serde_json::json!(story)))
            }
        }
    }

    fn map(&self, name: &str) -> std::result::Result<Response, Response> {
        let values = self.redraw()?.map(name).ok_or(Response::refusal(404))?;
        Ok(Response {
            status: 200,
            kind: "application/octet-stream",
            body: Cow::Owned(values),
        })
    }
}

impl Handler for View {
    fn respond(&self, path: &[&str], request: &Request) -> Response {
        let either = |answer: std::result::Result<Response, Response>| {
            answer.unwrap_or_else(|refusal| refusal)
        };
        match path {
            [""] => Response {
                status: 200,
                kind: "text/html; charset=utf-8",
                body: Cow::Owned(assets::page().into_bytes()),
            },
            ["folder"] => Response::json(self.folder.contents.to_string()),
            ["assets", name] => assets::ALL
                .iter()
                .find(|asset| asset.name == *name)
                .map_or_else(
                    || Response::refusal(404),
                    |asset| Response {
                        status: 200,
                        kind: asset.kind,
                        body: Cow::Borrowed(asset.text.as_bytes()),
                    },
                ),
            ["file", name] => match self.folder.file(name) {
                Ok(bytes) => Response {
                    status: 200,
                    kind: kind_of(name),
                    body: Cow::Owned(bytes),
                },
                Err((404, _)) => Response::refusal(404),
                Err((status, sentence)) => Response::sentence(status, &sentence),
            },
            ["map", name] => either(self.map(name)),
            [name] => either(self.computed(name, request)),
            _ => Response::refusal(404),
        }
    }
}

/// Media type of a file of a folder.
fn kind_of(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, end)| end) {
        Some("png") => "image/png",
        Some("json") => "application/json",
        _ => "text/plain; charset=utf-8",
    }
}
