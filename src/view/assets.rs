//! Assets: the files of the page, embedded in the program.

/// A file of the page.
#[derive(Clone, Copy, Debug)]
pub struct Asset {
    /// Its name.
    pub name: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// Its contents.
    pub text: &'static str,
}

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// Files of the page, in the order in which it loads them.
pub const ALL: [Asset; 12] = [
    Asset {
        name: "uPlot.min.css",
        kind: STYLE,
        text: include_str!("assets/uplot/uPlot.min.css"),
    },
    Asset {
        name: "view.css",
        kind: STYLE,
        text: include_str!("assets/view.css"),
    },
    Asset {
        name: "uPlot.iife.min.js",
        kind: SCRIPT,
        text: include_str!("assets/uplot/uPlot.iife.min.js"),
    },
    Asset {
        name: "source.js",
        kind: SCRIPT,
        text: include_str!("assets/source.js"),
    },
    Asset {
        name: "tiles.js",
        kind: SCRIPT,
        text: include_str!("assets/tiles.js"),
    },
    Asset {
        name: "frame.js",
        kind: SCRIPT,
        text: include_str!("assets/frame.js"),
    },
    Asset {
        name: "story.js",
        kind: SCRIPT,
        text: include_str!("assets/story.js"),
    },
    Asset {
        name: "machine.js",
        kind: SCRIPT,
        text: include_str!("assets/machine.js"),
    },
    Asset {
        name: "rows.js",
        kind: SCRIPT,
        text: include_str!("assets/rows.js"),
    },
    Asset {
        name: "compare.js",
        kind: SCRIPT,
        text: include_str!("assets/compare.js"),
    },
    Asset {
        name: "sequence.js",
        kind: SCRIPT,
        text: include_str!("assets/sequence.js"),
    },
    Asset {
        name: "view.js",
        kind: SCRIPT,
        text: include_str!("assets/view.js"),
    },
];

/// Title of the page, in its head.
pub const TITLE: &str = "<title>splatsim view</title>";

/// Body of the page, between styles and scripts.
const BODY: &str = include_str!("assets/body.html");

/// The page for the server: each asset is referenced by its name.
pub fn page() -> String {
    let [styles, scripts] = [STYLE, SCRIPT].map(|kind| {
        let assets = ALL
            .iter()
            .filter(|asset| asset.kind == kind)
            .map(|asset| match kind {
                STYLE => format!("<link rel=\"stylesheet\" href=\"assets/{}\">\n", asset.name),
                _ => format!("<script src=\"assets/{}\"></script>\n", asset.name),
            });
        assets.collect::<String>()
    });
    around(&styles, "", &scripts)
}

/// The page with all assets embedded; `folder` is JSON that cannot end a script element.
pub fn page_with(folder: &str) -> String {
    let [styles, scripts] = [STYLE, SCRIPT].map(|kind| {
        let assets = ALL
            .iter()
            .filter(|asset| asset.kind == kind)
            .map(|asset| match kind {
                STYLE => format!("<style>{}</style>\n", asset.text),
                _ => format!("<script>{}</script>\n", asset.text),
            });
        assets.collect::<String>()
    });
    // Nothing is requested: the page is complete.
    let nothing = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                   img-src data: blob:; base-uri 'none'; form-action 'none'\">\n";
    let folder = format!("<script type=\"application/json\" id=\"folder\">{folder}</script>\n");
    around(&(nothing.to_owned() + &styles), &folder, &scripts)
}

fn around(styles: &str, folder: &str, scripts: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n{TITLE}\n{styles}</head>\n\
         <body>\n{BODY}{folder}{scripts}</body>\n</html>\n"
    )
}
