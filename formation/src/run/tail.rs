//! The last lines of a process, in bounded memory whatever it writes.

use std::collections::VecDeque;
use std::io::{self, BufRead, Read};

/// How many lines of each process are kept.
pub const LINES_MAX: usize = 20;
/// Longer lines are cut when they are kept.
pub const LINE_BYTES_MAX: u64 = 2_000;

/// The last [`LINES_MAX`] lines that a process wrote.
#[derive(Debug, Default)]
pub struct Tail {
    lines: VecDeque<String>,
}

impl Tail {
    /// Adds a line, and drops the oldest if there are too many.
    pub fn push(&mut self, line: String) {
        if self.lines.len() == LINES_MAX {
            self.lines.pop_front();
        }
        self.lines.push_back(line);
    }

    /// The lines, oldest first.
    pub fn lines(&self) -> impl Iterator<Item = &str> {
        self.lines.iter().map(String::as_str)
    }
}

/// Passes every line of `reader` to `take` until the end, or until `take` returns false. Of lines longer than
/// `bytes_max` the rest is dropped, and the cut marked with dots.
///
/// # Errors
/// Returns what reading returns.
pub fn for_each_line(
    mut reader: impl BufRead,
    bytes_max: u64,
    mut take: impl FnMut(String) -> bool,
) -> io::Result<()> {
    let mut line = Vec::new();
    loop {
        line.clear();
        let read = reader
            .by_ref()
            .take(bytes_max + 1)
            .read_until(b'\n', &mut line)?;
        if read == 0 {
            return Ok(());
        }
        let is_whole = line.pop_if(|byte| *byte == b'\n').is_some();
        let is_cut = !is_whole && read as u64 > bytes_max;
        if is_cut {
            line.pop();
            reader.skip_until(b'\n')?;
        }
        let mut text = String::from_utf8_lossy(&line).into_owned();
        if is_cut {
            text.push_str("...");
        }
        if !take(text) {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufReader, Cursor};

    use super::*;

    fn lines_of(text: &[u8], bytes_max: u64) -> Vec<String> {
        let mut lines = Vec::new();
        // A tiny buffer, so that lines span several fillings.
        let reader = BufReader::with_capacity(3, Cursor::new(text));
        for_each_line(reader, bytes_max, |line| {
            lines.push(line);
            true
        })
        .unwrap();
        lines
    }

    #[test]
    fn lines_are_split_and_cut() {
        assert_eq!(lines_of(b"one\n\ntwo", 10), ["one", "", "two"]);
        assert_eq!(lines_of(b"12345\n123456\n7", 5), ["12345", "12345...", "7"]);
        assert_eq!(lines_of(b"12345\n123456", 5), ["12345", "12345..."]);
        assert_eq!(lines_of(&[b'x'; 100_000], 4), ["xxxx..."]);
        assert_eq!(lines_of(b"", 4), Vec::<String>::new());
        assert_eq!(lines_of(b"\xff\n", 4), ["\u{fffd}"]);
    }

    #[test]
    fn only_the_last_lines_are_kept() {
        let mut tail = Tail::default();
        for number in 0..1_000 {
            tail.push(number.to_string());
        }
        let kept: Vec<&str> = tail.lines().collect();
        assert_eq!(kept.len(), LINES_MAX);
        assert_eq!((kept[0], kept[LINES_MAX - 1]), ("980", "999"));
    }
}
