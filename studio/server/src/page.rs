//! The files of the page, which are part of the program.

/// A file of the page.
pub struct PageFile {
    /// Its path below the address of the page.
    pub name: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// Its content.
    pub content: &'static str,
}

const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! file {
    ($name:literal, $kind:expr) => {
        PageFile {
            name: $name,
            kind: $kind,
            content: include_str!(concat!("../../page/", $name)),
        }
    };
}

/// All of them.
const FILES: &[PageFile] = &[
    file!("index.html", HTML),
    file!("studio.css", STYLE),
    file!("main.js", SCRIPT),
    file!("engine.js", SCRIPT),
    file!("drawing.js", SCRIPT),
    file!("editor.js", SCRIPT),
    file!("stage.js", SCRIPT),
    file!("film.js", SCRIPT),
    file!("live.js", SCRIPT),
];

/// The page may run its own scripts, ask this studio, and load nothing from elsewhere.
pub const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The file of a path below the address.
pub fn file(path: &str) -> Option<&'static PageFile> {
    let name = match path {
        "" => "index.html",
        path => path,
    };
    FILES.iter().find(|file| file.name == name)
}
