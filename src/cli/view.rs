//! View: shows a result folder in a browser, or writes the page as a file.

use crate::error::{Error, Result};
use crate::view::server::Server;
use crate::view::{View, export};
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

#[derive(Args, Debug)]
pub(super) struct ViewArgs {
    /// Folder of run, replay, compare, sweep, search or stress
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Write one self-contained page instead
    #[arg(long, value_name = "FILE.html", conflicts_with_all = ["seconds", "scene"])]
    export: Option<PathBuf>,
    /// Do not open a browser
    #[arg(long)]
    no_open: bool,
    /// Stop after N seconds [default: at Ctrl-C]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    seconds: Option<u32>,
    /// Read the scene from here if it has moved
    #[arg(long, value_name = "NAME|FILE")]
    scene: Option<OsString>,
}

impl ViewArgs {
    pub fn run(self) -> Result<String> {
        let view = View::new(&self.folder, self.scene)?;
        if let Some(path) = self.export {
            export::write(&view, &path)?;
            return Ok(format!("written: {}", path.display()));
        }
        let server = Server::open()?;
        let address = server.address();
        super::print(&format!("{address}\nCtrl-C ends it"))?;
        if !self.no_open {
            open(&address)?;
        }
        server.serve(
            view,
            self.seconds
                .map(|seconds| Duration::from_secs(seconds.into())),
        );
        Ok(String::new())
    }
}

/// Opens an address in the default browser.
fn open(address: &str) -> Result<()> {
    let (program, arguments): (_, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let quiet = Command::new(program)
        .args(arguments)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    match quiet {
        Ok(_) => Ok(()),
        // Without such a program the user opens the printed address.
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(e) => Err(Error::job(format!(
            "{program}: cannot be started: {e}; --no-open does not open a browser"
        ))),
    }
}
