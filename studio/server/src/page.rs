//! The files of the page, which the library contains.

/// The name of each file, and what is in it.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/page_files.rs"));

/// The type and the content of a file of the page; the empty name is that of the page itself.
pub(crate) fn file(name: &str) -> Option<(&'static str, &'static [u8])> {
    let name = match name {
        "" => "index.html",
        name => name,
    };
    let &(_, content) = FILES.iter().find(|(known, _)| *known == name)?;
    let (_, end) = name.rsplit_once('.')?;
    Some((content_type(end)?, content))
}

fn content_type(end: &str) -> Option<&'static str> {
    Some(match end {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "json" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "wasm" => "application/wasm",
        _ => return None,
    })
}
