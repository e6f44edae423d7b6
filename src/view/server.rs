//! Server: answers requests on 127.0.0.1 that contain the token of its address, for a limited time
//! or until the process ends.
//!
//! ```text
//! connection ─┬─► more than 32 at once: 503
//!             └─► thread ─► head ─► Host is ours? ─► token is ours? ─► Handler ─► response, connection closed
//! ```
//! A page of another origin cannot read responses, because it does not have the token. It cannot
//! reach the server under another name (DNS rebinding) either, because `Host` must be this address.
//! The handler behind the token decides what can be requested: a path of a request is never a path
//! of a file.
//!
//! Laws (tests/view.rs): `who_has_no_token_gets_nothing`, `no_path_leads_out_of_the_folder`,
//! `hostile_requests_end_in_an_error_and_the_rest_goes_on`.

use super::http::{self, Request, Response};
use crate::error::{Error, Result};
use std::io::Read;
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Greatest number of open connections; a browser opens six.
const MOST_CONNECTIONS: usize = 32;
/// Time for the client to accept a part of a response.
const TAKE_TIME: Duration = Duration::from_secs(30);
/// Limits of what is read from a refused request, so that its sender receives the refusal: bytes,
/// and time.
const MOST_DRAINED_BYTES: usize = 64 * 1024;
const DRAIN_TIME: Duration = Duration::from_millis(200);

/// Handler of requests with the right token.
pub trait Handler: Send + Sync + 'static {
    /// The response to a request; `path` is without the token.
    fn respond(&self, path: &[&str], request: &Request) -> Response;
}

/// A listening server.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    port: u16,
    token: String,
}

impl Server {
    /// Listens on a free port of this computer, which no other computer can reach.
    ///
    /// # Errors
    /// [`Error::Job`] if there is no free port, or no randomness for the token.
    pub fn open() -> Result<Self> {
        let failed = |what: &str| Error::job(format!("127.0.0.1: cannot be listened on: {what}"));
        let listener =
            TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(|e| failed(&e.to_string()))?;
        let port = listener
            .local_addr()
            .map_err(|e| failed(&e.to_string()))?
            .port();
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(|e| failed(&format!("no random token: {e}")))?;
        Ok(Server {
            listener,
            port,
            token: crate::output::text::hex(&random),
        })
    }

    /// The address to be opened in a browser.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Serves requests until the time is over; without one, until the process ends.
    pub fn serve(self, handler: impl Handler, time: Option<Duration>) {
        let thread = thread::spawn(move || {
            let (shared, open) = (
                Arc::new((self.port, self.token, handler)),
                Arc::new(AtomicUsize::new(0)),
            );
            for stream in self.listener.incoming() {
                let Ok(stream) = stream else {
                    // For example out of handles: open connections will be closed.
                    thread::sleep(Duration::from_millis(50));
                    continue;
                };
                let Some(place) = ConnectionSlot::take(&open) else {
                    refuse(stream, 503);
                    continue;
                };
                let shared = Arc::clone(&shared);
                let started = thread::Builder::new().spawn(move || {
                    let (port, token, handler) = &*shared;
                    handle_connection(stream, *port, token, handler);
                    drop(place);
                });
                // The closure of a thread that cannot be started has closed its connection.
                drop(started);
            }
        });
        match time {
            Some(time) => thread::sleep(time),
            None => _ = thread.join(),
        }
    }
}

/// One of the connections that may be open.
struct ConnectionSlot(Arc<AtomicUsize>);

impl ConnectionSlot {
    fn take(open: &Arc<AtomicUsize>) -> Option<Self> {
        let place = ConnectionSlot(Arc::clone(open));
        (open.fetch_add(1, Ordering::SeqCst) < MOST_CONNECTIONS).then_some(place)
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Reads a request and responds. All failures of the connection are the client's.
fn handle_connection(mut stream: TcpStream, port: u16, token: &str, handler: &impl Handler) {
    let request = http::read_head(&mut stream, |stream, left| {
        _ = stream.set_read_timeout(Some(left))
    })
    .and_then(|head| http::parse(&head));
    let request = match request {
        Ok(request) => request,
        Err(status) => return refuse(stream, status),
    };
    if ![format!("127.0.0.1:{port}"), format!("localhost:{port}")].contains(&request.host) {
        return refuse(stream, 421);
    }
    let path: Vec<&str> = request.path.iter().map(String::as_str).collect();
    let Some((_, rest)) = path
        .split_first()
        .filter(|(first, _)| is_equal(first.as_bytes(), token.as_bytes()))
    else {
        return refuse(stream, 403);
    };
    let response = handler.respond(rest, &request);
    let _ = stream.set_write_timeout(Some(TAKE_TIME));
    if response.write(&mut stream, request.head_only).is_ok() {
        let _ = stream.shutdown(Shutdown::Both);
    }
}

/// Sends a status and closes. Some of the remaining input is read first; otherwise the client would
/// receive a reset instead of the status.
fn refuse(mut stream: TcpStream, status: u16) {
    let _ = stream.set_write_timeout(Some(DRAIN_TIME));
    if Response::refusal(status).write(&mut stream, false).is_err()
        || stream.shutdown(Shutdown::Write).is_err()
        || status == 503
    {
        return;
    }
    let end = Instant::now() + DRAIN_TIME;
    let mut left = MOST_DRAINED_BYTES;
    let mut part = [0; 4096];
    while left > 0 {
        let time = end.saturating_duration_since(Instant::now());
        if time.is_zero() || stream.set_read_timeout(Some(time)).is_err() {
            return;
        }
        match stream.read(&mut part) {
            Ok(length) if length > 0 => left = left.saturating_sub(length),
            _ => return,
        }
    }
}

/// Whether two texts are equal, in a time that does not depend on the position of a difference.
fn is_equal(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len()
        && a.iter()
            .zip(b)
            .fold(0, |different, (a, b)| different | a ^ b)
            == 0
}
