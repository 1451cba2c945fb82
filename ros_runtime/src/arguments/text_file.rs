//! Reading files whose size is bounded.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Reads a text file of at most `bytes_max` bytes.
pub fn read(path: &Path, bytes_max: u64) -> io::Result<String> {
    let mut text = String::new();
    File::open(path)?
        .take(bytes_max + 1)
        .read_to_string(&mut text)?;
    if text.len() as u64 > bytes_max {
        return Err(io::Error::other(format!(
            "is larger than {bytes_max} bytes"
        )));
    }
    Ok(text)
}
