//! Does `view` respond only to clients with the token, and does it serve only files of the folder
//! (docs/book/view.md)? Requests are written byte by byte; the page's behaviour is tested by
//! `tests/browser.rs`.

use crate::program::PROGRAM;
use proptest::prelude::*;
use serde_json::{Value, json};
use splatsim::view::http::{Request, Response};
use splatsim::view::server::{Handler, Server};
use splatsim::view::{View, assets, export};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::Duration;

/// A folder of a small run, and other folders.
struct RunFolder {
    folder: tempfile::TempDir,
}

impl RunFolder {
    fn run(&self) -> std::path::PathBuf {
        self.folder.path().join("run")
    }

    fn scene(&self) -> String {
        self.folder
            .path()
            .join("few.json")
            .to_str()
            .unwrap()
            .to_owned()
    }
}

static MADE: LazyLock<RunFolder> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("secret.png"), "nobody's").unwrap();
    let out = folder.path().join("run");
    let scene = folder.path().join("few.json");
    // Few splats, because the program may be a debug build.
    std::fs::write(
        &scene,
        r#"{"splats": {"builtin": "glass-spheres", "count": 5000}}"#,
    )
    .unwrap();
    let arguments = [
        "run",
        scene.to_str().unwrap(),
        "--size",
        "40x32",
        "--machine",
        "tiny",
        "--quiet",
        "--out",
        out.to_str().unwrap(),
    ];
    assert!(
        Command::new(PROGRAM.as_str())
            .args(arguments)
            .status()
            .unwrap()
            .success()
    );
    std::fs::create_dir(out.join("below")).unwrap();
    std::fs::write(out.join("below/secret.json"), "nobody's").unwrap();
    std::fs::write(out.join("notes.txt"), "nobody's").unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.path().join("secret.png"), out.join("link.png")).unwrap();
    RunFolder { folder }
});

/// A server in this process for a folder.
struct Served {
    host: String,
    token: String,
}

fn served(answers: impl Handler) -> Served {
    let server = Server::open().unwrap();
    let address = server.address();
    let (host, token) = address
        .strip_prefix("http://")
        .unwrap()
        .split_once('/')
        .unwrap();
    let served = Served {
        host: host.into(),
        token: token.trim_end_matches('/').into(),
    };
    thread::spawn(move || server.serve(answers, None));
    served
}

static SERVED: LazyLock<Served> = LazyLock::new(|| served(View::new(&MADE.run(), None).unwrap()));

impl Served {
    /// The complete response to some bytes; empty if the connection was cut.
    fn sent(&self, bytes: &[u8]) -> Vec<u8> {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(30)))
            .unwrap();
        // A client that is refused early may not have sent everything.
        let _ = stream.write_all(bytes);
        let _ = stream.shutdown(Shutdown::Write);
        let mut back = Vec::new();
        let _ = stream.read_to_end(&mut back);
        back
    }

    fn status(&self, bytes: &[u8]) -> u16 {
        status_of(&self.sent(bytes))
    }

    /// Status and body of a path below the token.
    fn get(&self, path: &str) -> (u16, Vec<u8>) {
        let Served { host, token } = self;
        let back =
            self.sent(format!("GET /{token}/{path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes());
        let body = back
            .windows(4)
            .position(|four| four == b"\r\n\r\n")
            .map_or(back.len(), |at| at + 4);
        (status_of(&back), back[body..].to_vec())
    }

    fn json(&self, path: &str) -> Value {
        let (status, body) = self.get(path);
        assert_eq!(status, 200, "{path}: {}", String::from_utf8_lossy(&body));
        serde_json::from_slice(&body).unwrap()
    }
}

fn status_of(back: &[u8]) -> u16 {
    let line = String::from_utf8_lossy(&back[..back.len().min(12)]).into_owned();
    line.strip_prefix("HTTP/1.1 ")
        .and_then(|status| status.parse().ok())
        .unwrap_or(0)
}

fn splatsim(arguments: &[&str]) -> Output {
    assert_cmd::Command::new(PROGRAM.as_str())
        .args(arguments)
        .timeout(Duration::from_secs(60))
        .output()
        .unwrap()
}

// ---- Access ----

#[test]
fn who_has_no_token_gets_nothing() {
    let Served { host, token } = &*SERVED;
    let other = token.chars().rev().collect::<String>();
    let ask = |path: &str, host: &str| {
        SERVED.status(format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes())
    };
    for path in [
        "/",
        "/folder",
        "/favicon.ico",
        "/assets/view.js",
        "/file/fixed.png",
        &format!("/{other}/"),
        &format!("/{}/", &token[1..]),
    ] {
        assert_eq!(ask(path, host), 403, "{path}");
        let back = SERVED.sent(format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes());
        assert!(
            !String::from_utf8_lossy(&back).contains("splatsim"),
            "{path}"
        );
    }
    assert_eq!(ask(&format!("/{token}/"), host), 200);
    // Another host name for this address, as a page elsewhere may use.
    for foreign in ["example.org", "127.0.0.1", "127.0.0.1:1", "[::1]", ""] {
        assert_eq!(ask(&format!("/{token}/"), foreign), 421, "{foreign:?}");
    }
    assert_eq!(
        ask(
            &format!("/{token}/"),
            &host.replace("127.0.0.1", "localhost")
        ),
        200
    );
    assert_eq!(token.len(), 32);
    assert_ne!(served(Nothing).token, *token);
}

struct Nothing;

impl Handler for Nothing {
    fn respond(&self, _: &[&str], _: &Request) -> Response {
        Response::refusal(404)
    }
}

#[test]
fn hostile_requests_end_in_an_error_and_the_rest_goes_on() {
    let Served { host, token } = &*SERVED;
    let head = format!("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\n");
    for (what, bytes, status) in [
        ("half a request", format!("GET /{token}/ HT"), 400),
        ("no empty line", head.clone(), 400),
        ("no host", format!("GET /{token}/ HTTP/1.1\r\n\r\n"), 400),
        ("two hosts", format!("{head}Host: {host}\r\n\r\n"), 400),
        (
            "an endless field",
            format!("{head}X: {}", "x".repeat(100_000)),
            431,
        ),
        (
            "a body",
            format!("POST /{token}/ HTTP/1.1\r\nHost: {host}\r\nContent-Length: 3\r\n\r\nabc"),
            405,
        ),
        (
            "a gigabyte",
            format!(
                "{head}Content-Length: 1000000000\r\n\r\n{}",
                "x".repeat(1 << 20)
            ),
            413,
        ),
        (
            "chunks",
            format!("{head}Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
            413,
        ),
        ("another protocol", "\u{16}\u{3}\u{1}\r\n\r\n".into(), 400),
        (
            "a proxy's form",
            format!("GET http://{host}/{token}/ HTTP/1.1\r\nHost: {host}\r\n\r\n"),
            400,
        ),
    ] {
        assert_eq!(SERVED.status(bytes.as_bytes()), status, "{what}");
    }
    assert_eq!(SERVED.get("").0, 200);
}

#[test]
fn a_hundred_connections_at_once_are_answered_or_refused() {
    /// Does not respond before the test permits it.
    struct Held(std::sync::mpsc::SyncSender<()>, Arc<std::sync::Barrier>);
    impl Handler for Held {
        fn respond(&self, path: &[&str], _: &Request) -> Response {
            if path == ["held"] {
                self.0.send(()).unwrap();
                self.1.wait();
            }
            Response::json("1".into())
        }
    }
    let (arrived, arrivals) = std::sync::mpsc::sync_channel(100);
    let barrier = Arc::new(std::sync::Barrier::new(33));
    let served = Arc::new(served(Held(arrived, Arc::clone(&barrier))));
    let ask = || {
        let served = Arc::clone(&served);
        thread::spawn(move || served.get("held").0)
    };
    let held: Vec<_> = (0..32).map(|_| ask()).collect();
    (0..32).for_each(|_| arrivals.recv().unwrap());
    // All places are occupied, and stay so.
    let refused: Vec<u16> = (0..68)
        .map(|_| ask())
        .map(|asked| asked.join().unwrap())
        .collect();
    assert_eq!(refused, [503; 68]);
    barrier.wait();
    held.into_iter()
        .for_each(|asked| assert_eq!(asked.join().unwrap(), 200));
    // A place becomes free shortly after its response was sent.
    assert!((0..1000).any(|_| {
        thread::sleep(Duration::from_millis(20));
        served.get("").0 == 200
    }));
}

// ---- Served files ----

#[test]
fn no_path_leads_out_of_the_folder() {
    assert_eq!(
        SERVED.get("file/fixed.png"),
        (200, std::fs::read(MADE.run().join("fixed.png")).unwrap())
    );
    for path in [
        "file/../secret.png",
        "file/..%2fsecret.png",
        "file/%2e%2e/secret.png",
        "../secret.png",
        "file/below/secret.json",
        "file/below%2fsecret.json",
        "file/link.png",
        "file/notes.txt",
        "file//etc/passwd",
        "file/",
        "file",
        "assets/../mod.rs",
        "assets/body.html",
        "map/../bound",
        "map/none",
        "none",
        "/",
    ] {
        let (status, body) = SERVED.get(path);
        assert_eq!(
            (status, body.as_slice()),
            (404, &b"404 Not Found\n"[..]),
            "{path}"
        );
    }
    for path in ["pixel", "pixel?x=1", "pixel?x=-1&y=2", "story?x=a&y=0"] {
        assert_eq!(SERVED.get(path).0, 400, "{path}");
    }
    for path in [
        "pixel?x=40&y=0",
        "pixel?x=0&y=32",
        "story?x=18446744073709551615&y=0",
    ] {
        assert_eq!(SERVED.get(path).0, 404, "{path}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Any request gets a file of the folder, an asset, data of the frame, or an error.
    #[test]
    fn no_path_makes_the_answers_panic_or_tell_more(
        parts in prop::collection::vec(
            prop_oneof![
                "[ -~]{0,12}", Just("..".to_owned()), Just("file".to_owned()), Just("assets".to_owned()), Just("below".to_owned()),
                Just("secret.json".to_owned()), Just("secret.png".to_owned()), Just("link.png".to_owned()), Just("map".to_owned()), Just(String::new()),
                Just("fixed.png".to_owned()), Just("%2e%2e%2fsecret.png".to_owned()), Just("C:\\secret.png".to_owned()),
            ],
            0..6,
        ),
        x in any::<i64>(),
    ) {
        static VIEW: LazyLock<View> = LazyLock::new(|| View::new(&MADE.run(), None).unwrap());
        let request = Request { path: parts.clone(), query: vec![("x".into(), x.to_string()), ("y".into(), "1".into())], host: String::new(), head_only: false };
        let path: Vec<&str> = parts.iter().map(String::as_str).collect();
        // Redrawing is tested elsewhere.
        prop_assume!(!matches!(path.as_slice(), ["map", _] | ["pixel" | "story" | "drawn"]));
        let response = VIEW.respond(&path, &request);
        prop_assert!(!response.body.windows(8).any(|eight| eight == b"nobody's"), "{:?}", path);
        let known = matches!(path.as_slice(), [""] | ["folder"] | ["assets" | "file", _]);
        prop_assert_eq!(response.status, if known && response.status == 200 { 200 } else { 404 });
    }
}

#[test]
fn a_pixel_has_the_values_of_the_run() {
    let folder = SERVED.json("folder");
    let report: Value =
        serde_json::from_str(&std::fs::read_to_string(MADE.run().join("report.json")).unwrap())
            .unwrap();
    assert_eq!(folder["run"]["report"], report);
    assert_eq!(
        (&folder["run"]["machine_name"], &folder["run"]["pictures"]),
        (
            &json!("tiny"),
            &json!(["fixed", "golden", "ideal", "error", "flips"])
        )
    );
    assert_eq!(
        folder["charts"],
        json!(["bounds.png", "cycles.png", "ranges.png", "roofline.png"])
    );
    let pictures = ["fixed", "golden", "ideal"].map(|name| {
        (
            name,
            image::open(MADE.run().join(name).with_extension("png"))
                .unwrap()
                .into_rgba8(),
        )
    });
    let mut contributions = 0;
    for (x, y) in [(20, 16), (3, 30), (0, 0), (39, 31)] {
        let pixel = SERVED.json(&format!("pixel?x={x}&y={y}"));
        for (name, picture) in &pictures {
            // The oracle encodes by the standard's formula, independently of the program.
            let channels: Vec<f64> = pixel[*name]
                .as_array()
                .unwrap()
                .iter()
                .map(|channel| channel.as_f64().unwrap())
                .collect();
            let code = |linear: f64| {
                if linear <= 0.0031308 {
                    12.92 * linear
                } else {
                    1.055 * linear.powf(1.0 / 2.4) - 0.055
                }
            };
            let shown = picture.get_pixel(x, y).0;
            for channel in 0..3 {
                let straight = if channels[3] > 0.0 {
                    (channels[channel] / channels[3]).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                assert!(
                    (255.0 * code(straight) - f64::from(shown[channel])).abs() <= 0.51,
                    "{name} {x},{y}: {channels:?} {shown:?}"
                );
            }
        }
        // U1F8 of `tiny`: 256 steps.
        let number = |name: &str, channel: usize| pixel[name][channel].as_f64().unwrap();
        assert_eq!(pixel["format"], "U1F8");
        assert_eq!(number("words", 0) / 256.0, number("fixed", 0));
        assert!(
            (number("error", 1) * 256.0 - number("error_ulp", 1)).abs() < 1e-12
                && (number("error_255", 1) - 255.0 * number("error", 1)).abs() < 1e-12
        );
        let story = SERVED.json(&format!("story?x={x}&y={y}"));
        let on_machine = story["contributions"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|one| !one["fixed"].is_null())
            .count();
        assert_eq!(pixel["contributions"], on_machine);
        assert_eq!(
            pixel["layers"],
            story["layers"]["fixed"].as_array().unwrap().len()
        );
        assert_eq!(story["fixed"], pixel["fixed"]);
        contributions += on_machine;
    }
    assert!(contributions > 5);
}

#[test]
fn maps_add_up_to_the_report() {
    let report = &SERVED.json("folder")["run"]["report"];
    let sum = |name: &str| {
        let (status, bytes) = SERVED.get(&format!("map/{name}"));
        assert_eq!((status, bytes.len()), (200, 40 * 32 * 4), "{name}");
        bytes
            .as_chunks()
            .0
            .iter()
            .map(|four| f64::from(f32::from_le_bytes(*four)))
            .sum::<f64>()
    };
    assert_eq!(
        json!(sum("contributions") as u64),
        report["scene"]["fragments"]
    );
    assert_eq!(json!(sum("merges") as u64), report["fragments"]["merged"]);
    assert!(
        sum("layers") <= sum("covered") * 3.0
            && sum("layers") >= sum("covered")
            && sum("bound") > 0.0
    );
}

/// Both describe a decision in the same words, and equal decisions are not flips. On a machine of
/// windows, sums are counted separately from merges.
#[test]
fn a_pixel_trace_on_a_machine_of_windows_has_the_same_words_for_both() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let arguments = [
        "run",
        &MADE.scene(),
        "--size",
        "24x20",
        "--machine",
        "window",
        "--quiet",
        "--out",
        out.to_str().unwrap(),
    ];
    assert!(splatsim(&arguments).status.success());
    let served = served(View::new(&out, None).unwrap());
    let report = &served.json("folder")["run"]["report"];
    let merges: Vec<f32> = served
        .get("map/merges")
        .1
        .as_chunks()
        .0
        .iter()
        .map(|four| f32::from_le_bytes(*four))
        .collect();
    assert_eq!(
        json!(merges.iter().sum::<f32>() as u64),
        report["fragments"]["merged"]
    );
    assert!(
        report["fragments"]["summed"].as_u64().unwrap() > 0,
        "{}",
        report["fragments"]
    );
    let most = (0..merges.len())
        .max_by(|a, b| merges[*a].total_cmp(&merges[*b]))
        .unwrap();
    let story = served.json(&format!("story?x={}&y={}", most % 24, most / 24));
    let mut agreed = 0;
    for one in story["contributions"].as_array().unwrap() {
        let [fixed, golden] =
            ["fixed", "golden"].map(|whose| one[whose]["decision"].as_str().unwrap_or("none"));
        let is_close = |decision: &str| {
            ["close the deepest two", "close the deepest inside"].contains(&decision)
        };
        assert!(
            [fixed, golden]
                .iter()
                .all(|decision| !decision.starts_with("close") || is_close(decision)),
            "{fixed}, {golden}"
        );
        agreed += usize::from(is_close(fixed) && fixed == golden && one["flip"] == false);
    }
    assert!(agreed > 0, "{story}");
}

#[test]
fn a_pixel_trace_is_that_of_explain() {
    let output = splatsim(&[
        "explain",
        &MADE.scene(),
        "--size",
        "40x32",
        "--machine",
        "tiny",
        "--pixel",
        "20,16",
        "--json",
    ]);
    let story: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(story, SERVED.json("story?x=20&y=16"));
    // The text has the same content, row by row.
    let text = splatsim(&[
        "explain",
        &MADE.scene(),
        "--size",
        "40x32",
        "--machine",
        "tiny",
        "--pixel",
        "20,16",
    ])
    .stdout;
    let text = String::from_utf8(text).unwrap();
    for one in story["contributions"].as_array().unwrap() {
        let weight = one["fixed"]["weight"]
            .as_f64()
            .map_or("–".into(), |weight| format!("{weight:.6}"));
        let row = text
            .lines()
            .find(|line| line.split_whitespace().next() == Some(&one["splat"].to_string()))
            .unwrap();
        assert!(
            row.contains(&weight) && row.contains('◄') == one["flip"].as_bool().unwrap(),
            "{row}"
        );
        assert!(
            row.contains(one["fixed"]["decision"].as_str().unwrap_or("none")),
            "{row}"
        );
    }
}

#[test]
fn a_changed_scene_is_reported_and_not_redrawn() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("few.json");
    let write_before = |count: u32, fov: u32, cutoff: f64, background: f64| {
        let camera = format!(
            r#"{{"eye": [0, 2, 4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": {fov}, "near": 0.05}}"#
        );
        let splats = format!(r#"{{"builtin": "checkerboard", "count": {count}}}"#);
        let rest = format!(
            r#""kernel": {{"cutoff": {cutoff}}}, "image": {{"background": [{background}, 0.5, 0.5, 1]}}"#
        );
        std::fs::write(
            &scene,
            format!(r#"{{"splats": {splats}, "camera": {camera}, {rest}}}"#),
        )
        .unwrap();
    };
    let write = |count: u32, fov: u32, cutoff: f64| write_before(count, fov, cutoff, 0.5);
    write(2000, 60, 2.0);
    let out = folder.path().join("out");
    let arguments = [
        "run",
        scene.to_str().unwrap(),
        "--size",
        "24x20",
        "--machine",
        "tiny",
        "--quiet",
        "--out",
        out.to_str().unwrap(),
    ];
    assert!(splatsim(&arguments).status.success());
    for (count, fov, cutoff, background, what) in [
        (1000, 60, 2.0, 0.5, "splats, and "),
        (2000, 50, 2.0, 0.5, "another camera"),
        (2000, 60, 1.0, 0.5, "contributions, and "),
        (
            2000,
            60,
            2.0,
            0.3,
            "another picture: colours, lights, or the version that drew it differ",
        ),
    ] {
        write_before(count, fov, cutoff, background);
        let changed = served(View::new(&out, None).unwrap());
        let (status, sentence) = changed.get("pixel?x=1&y=1");
        let sentence = String::from_utf8(sentence).unwrap();
        let is_told = sentence.contains("few.json: is no longer the scene of report.json")
            && sentence.contains(what);
        assert!(status == 503 && is_told, "{status} {sentence}");
        assert_eq!(changed.get("file/fixed.png").0, 200);
    }
    // The scene's new path can be given.
    write(2000, 60, 2.0);
    let other = folder.path().join("other.json");
    std::fs::rename(&scene, &other).unwrap();
    assert!(
        String::from_utf8(
            served(View::new(&out, None).unwrap())
                .get("pixel?x=1&y=1")
                .1
        )
        .unwrap()
        .contains("no such file")
    );
    let moved = served(View::new(&out, Some(other.into())).unwrap());
    assert_eq!(moved.get("pixel?x=1&y=1").0, 200);
}

// ---- Folders ----

#[test]
fn folders_that_cannot_be_shown_are_refused_in_a_sentence() {
    let refused = |arguments: &[&str], part: &str| {
        let output = splatsim(&[&["view", "--no-open"], arguments].concat());
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), output.stdout.as_slice()),
            (Some(2), &b""[..]),
            "{arguments:?}: {told}"
        );
        assert!(
            told.contains(part) && told.trim_end().lines().count() == 1,
            "{told}"
        );
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    refused(&[], "DIR");
    refused(&[path], "holds nothing that view shows");
    refused(&["/nowhere/at/all"], "/nowhere/at/all: cannot be read");
    refused(
        &[MADE.run().join("report.json").to_str().unwrap()],
        "is a file",
    );
    refused(&[path, "--seconds", "0"], "--seconds");
    let with = |name: &str, bytes: &[u8], part: &str| {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        refused(&[path], part);
        std::fs::remove_file(folder.path().join(name)).unwrap();
    };
    with(
        "report.json",
        b"{\"scene\": ",
        "report.json: is not JSON that splatsim wrote",
    );
    with(
        "report.json",
        b"{\"report\": \"of something else\"}",
        "report.json: has no scene.name: it is not a report of `run`",
    );
    with("report.json", b"[\xff]", "report.json: cannot be read");
    with("cycles.json", b"[]", "is not an account of cycles");
    with(
        "stress.json",
        b"{\"cases\": 3}",
        "stress.json: has no cases",
    );
    with(
        "choices.json",
        b"{\"choices\": [1, {\"rule\": {}}]}",
        "choices.json: has no choices",
    );
    with(
        "points.jsonl",
        b"[\"point: Whole\"]\n",
        "plan.json: is missing",
    );
    // A small file with as many cells as pairs of rows and names; or names that grow along a tree.
    let sparse: Vec<String> = (0..4000).map(|nth| format!("{{\"c{nth}\": 1}}")).collect();
    with(
        "choices.json",
        format!("{{\"choices\": [{}]}}", sparse.join(",")).as_bytes(),
        "choices.json: has more than 10,000,000 cells",
    );
    let deep = format!("{{\"{}\": [{}0]}}", "x".repeat(1 << 20), "0,".repeat(1000));
    with(
        "choices.json",
        format!("{{\"choices\": [{deep}]}}").as_bytes(),
        "choices.json: has more than 10,000,000 cells",
    );
    #[cfg(unix)]
    {
        let rows = folder.path().join("points.jsonl");
        std::os::unix::fs::symlink("/dev/zero", &rows).unwrap();
        refused(&[path], "points.jsonl: is a link or not a file");
        std::fs::remove_file(&rows).unwrap();
        assert!(
            Command::new("mkfifo")
                .arg(&rows)
                .status()
                .unwrap()
                .success()
        );
        refused(&[path], "points.jsonl: is a link or not a file");
        std::fs::remove_file(&rows).unwrap();
    }
    for name in ["points-2-of-5.jsonl", "report.json"] {
        let large = folder.path().join(name);
        // A hole of 300 MB.
        std::fs::File::create(&large)
            .unwrap()
            .set_len(300 << 20)
            .unwrap();
        refused(&[path], "has 300 MB");
        std::fs::remove_file(&large).unwrap();
    }
    // A report with pictures of another run, or without pictures.
    let report = std::fs::read(MADE.run().join("report.json")).unwrap();
    std::fs::write(folder.path().join("report.json"), &report).unwrap();
    with("fixed.png", b"GIF89a", "fixed.png: is not a picture");
    let other = folder.path().join("error.png");
    image::RgbaImage::new(3, 2).save(&other).unwrap();
    refused(&[path], "error.png: is 3×2, and report.json is of 40×32");
    std::fs::remove_file(other).unwrap();
    let text = String::from_utf8(report)
        .unwrap()
        .replace("\"layers\": 3", "\"layers\": 99");
    std::fs::write(folder.path().join("report.json"), text).unwrap();
    refused(
        &[path],
        "report.json: machine tiny cannot be built: fragment.layers is 99",
    );
}

/// A page shows one run: a file that has changed since is not served.
#[test]
fn files_that_changed_since_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["report.json", "fixed.png", "error.png", "cycles.png"] {
        std::fs::copy(MADE.run().join(name), folder.path().join(name)).unwrap();
    }
    let large = folder.path().join("large.csv");
    std::fs::File::create(&large)
        .unwrap()
        .set_len(300 << 20)
        .unwrap();
    let view = View::new(folder.path(), None).unwrap();
    let answer = |name: &str| {
        let request = Request {
            path: Vec::new(),
            query: Vec::new(),
            host: String::new(),
            head_only: false,
        };
        let response = view.respond(&["file", name], &request);
        (
            response.status,
            String::from_utf8_lossy(&response.body).into_owned(),
        )
    };
    assert_eq!(answer("fixed.png").0, 200);
    assert_eq!(
        answer("large.csv"),
        (
            413,
            "large.csv: has 300 MB; a file of splatsim has at most 256".into()
        )
    );
    let changed = |name: &str| {
        (
            409,
            format!("{name}: has changed since view read the folder: restart view"),
        )
    };
    // Another length; the same length at another time; another kind; missing.
    let path = |name: &str| folder.path().join(name);
    std::fs::OpenOptions::new()
        .append(true)
        .open(path("fixed.png"))
        .unwrap()
        .write_all(b"x")
        .unwrap();
    let later = std::time::SystemTime::now() + Duration::from_secs(100);
    std::fs::File::options()
        .write(true)
        .open(path("error.png"))
        .unwrap()
        .set_modified(later)
        .unwrap();
    std::fs::remove_file(path("cycles.png")).unwrap();
    std::fs::create_dir(path("cycles.png")).unwrap();
    std::fs::remove_file(path("report.json")).unwrap();
    for name in ["fixed.png", "error.png", "cycles.png", "report.json"] {
        assert_eq!(answer(name), changed(name));
    }
    assert!(
        export::html(&view)
            .unwrap_err()
            .to_string()
            .contains("has changed since")
    );
}

#[test]
fn rows_of_every_kind_are_served() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("choices.json"),
        r#"{"scenes": ["a"], "by": "area", "choices": [{"rule": "window", "layers": 2, "psnr_db": [30.5]}, {"rule": "none", "layers": 2, "psnr_db": [null]}]}"#,
    )
    .unwrap();
    std::fs::write(
        folder.path().join("stress.json"),
        r#"{"version": "0", "cases": [{"name": "edge", "machines": [{"machine": "tiny", "points": [{"value": 1, "drawn": {"psnr_db": 3}}, {"value": 2, "refused": "no"}]}]}]}"#,
    )
    .unwrap();
    let view = View::new(folder.path(), None).unwrap();
    let tables = &view.folder().contents["tables"];
    assert_eq!(
        tables[0]["columns"],
        json!([
            {"name": "by", "kind": "text", "rows": 2, "same": "area"},
            {"name": "rule", "kind": "text", "values": ["window", "none"]},
            {"name": "layers", "kind": "number", "rows": 2, "same": 2},
            {"name": "psnr_db", "kind": "number", "values": [30.5, null]},
        ])
    );
    assert_eq!(
        tables[1]["columns"],
        json!([
            {"name": "name", "kind": "text", "rows": 2, "same": "edge"},
            {"name": "machine", "kind": "text", "rows": 2, "same": "tiny"},
            {"name": "value", "kind": "number", "values": [1, 2]},
            {"name": "drawn.psnr_db", "kind": "number", "values": [3, null]},
            {"name": "refused", "kind": "text", "values": [null, "no"]},
        ])
    );
    // A header above many rows is repeated in each, so a long text is refused.
    let long =
        json!({"notes": "x".repeat(2000), "by": "area", "choices": [{"layers": 1}, {"layers": 2}]});
    std::fs::write(folder.path().join("choices.json"), long.to_string()).unwrap();
    let view = View::new(folder.path(), None).unwrap();
    let columns = view.folder().contents["tables"][0]["columns"]
        .as_array()
        .unwrap();
    assert_eq!(
        columns
            .iter()
            .map(|column| column["name"].as_str().unwrap())
            .collect::<Vec<_>>(),
        ["by", "layers"]
    );
}

// ---- The command ----

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn view_ends_after_its_seconds() {
    let output = splatsim(&[
        "view",
        MADE.run().to_str().unwrap(),
        "--no-open",
        "--seconds",
        "1",
    ]);
    assert!(output.status.success() && output.stdout.starts_with(b"http://127.0.0.1:"));
}

#[test]
fn view_prints_its_address_and_responds_there() {
    let arguments = [
        "view",
        MADE.folder.path().join("run").to_str().unwrap(),
        "--no-open",
        "--seconds",
        "600",
    ]
    .map(str::to_owned);
    let mut running = Running(
        Command::new(PROGRAM.as_str())
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap(),
    );
    let mut text = String::new();
    let mut out = running.0.stdout.take().unwrap();
    let mut byte = [0];
    while !text.ends_with('\n') {
        assert_eq!(out.read(&mut byte).unwrap(), 1, "{text}");
        text.push(byte[0].into());
    }
    let (host, token) = text
        .trim()
        .strip_prefix("http://")
        .unwrap()
        .split_once('/')
        .unwrap();
    let served = Served {
        host: host.into(),
        token: token.trim_end_matches('/').into(),
    };
    assert!(host.starts_with("127.0.0.1:"));
    assert_eq!(served.get("").0, 200);
}

// ---- Export, and third-party files ----

#[test]
fn an_export_names_nothing_outside_of_itself() {
    let view = View::new(&MADE.run(), None).unwrap();
    let page = export::html(&view).unwrap();
    let outside = [
        "src=\"",
        "href=\"assets",
        "@import",
        "url(h",
        "url(/",
        "url(\"",
    ]
    .into_iter()
    .find(|word| page.contains(word));
    assert_eq!(outside, None);
    // The only address is the name space of SVG's elements, which is not opened, and the home page
    // of uPlot in its comment.
    let known = [
        "http://www.w3.org/2000/svg",
        "https://github.com/leeoniya/uPlot",
    ];
    let addresses: Vec<&str> = page
        .match_indices("://")
        .map(|(at, _)| &page[at - 5..(at + 40).min(page.len())])
        .collect();
    assert!(
        addresses
            .iter()
            .all(|address| known.iter().any(|known| address
                .trim_start_matches([':', '\'', '('])
                .starts_with(&known[..20]))),
        "{addresses:?}"
    );
    let start = page.find("id=\"folder\">").unwrap() + 12;
    let told = &page[start..start + page[start..].find("</script>").unwrap()];
    let told: Value = serde_json::from_str(told).unwrap();
    assert!(
        told["files"]["fixed.png"]
            .as_str()
            .unwrap()
            .starts_with("data:image/png;base64,iVBOR")
    );
    let mut shown: Vec<&String> = told["files"].as_object().unwrap().keys().collect();
    shown.sort();
    assert_eq!(
        shown,
        [
            "bounds.png",
            "cycles.png",
            "error.png",
            "fixed.png",
            "flips.png",
            "golden.png",
            "ideal.png",
            "ranges.png",
            "roofline.png"
        ],
        "what the page shows, and no link"
    );
    // The export must not contain the maker's folders.
    let root = MADE.folder.path().file_name().unwrap().to_str().unwrap();
    assert!(!page.contains(root) && view.folder().contents.to_string().contains(root));
    assert_eq!(
        (
            &told["run"]["scene"],
            told["run"]["report"]["host"].get("scene_file")
        ),
        (&json!("few.json"), None)
    );
    let file = MADE.folder.path().join("page.html");
    let output = splatsim(&[
        "view",
        MADE.run().to_str().unwrap(),
        "--export",
        file.to_str().unwrap(),
    ]);
    assert!(output.status.success() && std::fs::read_to_string(&file).unwrap() == page);
    let refused = splatsim(&[
        "view",
        MADE.run().to_str().unwrap(),
        "--export",
        "/nowhere/page.html",
    ]);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(
        splatsim(&[
            "view",
            MADE.run().to_str().unwrap(),
            "--export",
            "a.html",
            "--seconds",
            "3"
        ])
        .status
        .code(),
        Some(2)
    );
}

/// A name from a report must not end the script that contains it.
#[test]
fn no_name_in_a_report_becomes_part_of_the_page() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("choices.json"),
        r#"{"choices": [{"rule": "</script><script>alert(1)</script><!--"}]}"#,
    )
    .unwrap();
    // A picture that no tab shows is not in the page.
    image::RgbaImage::new(3, 2)
        .save(folder.path().join("fixed.png"))
        .unwrap();
    let page = export::html(&View::new(folder.path(), None).unwrap()).unwrap();
    assert!(page.contains("\"files\":{}"));
    assert!(!page.contains("<script>alert") && page.contains("\\u003cscript>alert"));
}

#[test]
fn the_charting_library_is_the_one_that_was_published() {
    use sha2::{Digest, Sha256};
    let digest = |text: &[u8]| {
        Sha256::digest(text)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect::<String>()
    };
    let asset = |name: &str| {
        assets::ALL
            .iter()
            .find(|asset| asset.name == name)
            .unwrap()
            .text
    };
    // Of uplot-1.6.32.tgz from registry.npmjs.org, shasum c800a63b432bad692d6d746f44f0882aa73a49ae.
    assert_eq!(
        digest(asset("uPlot.iife.min.js").as_bytes()),
        "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f"
    );
    assert_eq!(
        digest(asset("uPlot.min.css").as_bytes()),
        "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04"
    );
    let licence =
        std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/view/assets/uplot/LICENSE"))
            .unwrap();
    assert_eq!(
        digest(&licence),
        "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd"
    );
    let own: usize = assets::ALL.iter().map(|asset| asset.text.len()).sum();
    assert!(own < 192_000, "{own} bytes of page are in the program");
}

#[test]
fn a_slow_response_delays_no_other_client() {
    struct Slow(Arc<std::sync::Barrier>);
    impl Handler for Slow {
        fn respond(&self, path: &[&str], _: &Request) -> Response {
            if path == ["slow"] {
                self.0.wait();
            }
            Response::json("1".into())
        }
    }
    let barrier = Arc::new(std::sync::Barrier::new(2));
    let served = Arc::new(served(Slow(Arc::clone(&barrier))));
    let slow = {
        let served = Arc::clone(&served);
        thread::spawn(move || served.get("slow").0)
    };
    assert_eq!(served.get("quick").0, 200);
    barrier.wait();
    assert_eq!(slow.join().unwrap(), 200);
}
