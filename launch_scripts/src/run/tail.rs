//! The last lines of a process, in bounded memory whatever it writes.

use std::collections::VecDeque;
use std::io::{self, BufRead, ErrorKind};

/// So many lines are kept of each process.
pub const LINES_MAX: usize = 20;
/// Longer lines are cut when they are kept.
pub const LINE_BYTES_MAX: usize = 2_000;

/// The last [`LINES_MAX`] lines that a process wrote.
#[derive(Debug, Default)]
pub struct Tail {
    lines: VecDeque<String>,
}

impl Tail {
    /// Adds a line, and forgets the oldest if there are too many.
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

/// Hands every line of `reader` to `take` until the end, or until `take` returns false. Of lines longer than
/// `bytes_max` the rest is dropped, and the cut marked with dots.
///
/// # Errors
/// Returns what reading returns.
pub fn for_each_line(
    mut reader: impl BufRead,
    bytes_max: usize,
    mut take: impl FnMut(String) -> bool,
) -> io::Result<()> {
    let mut line = Vec::new();
    let mut cut = false;
    let mut finish = |line: &mut Vec<u8>, cut: &mut bool| {
        let mut text = String::from_utf8_lossy(line).into_owned();
        if std::mem::take(cut) {
            text.push_str("...");
        }
        line.clear();
        take(text)
    };
    loop {
        let buffer = match reader.fill_buf() {
            Ok(buffer) => buffer,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        if buffer.is_empty() {
            if !line.is_empty() {
                finish(&mut line, &mut cut);
            }
            return Ok(());
        }
        let end = buffer.iter().position(|&byte| byte == b'\n');
        let part = &buffer[..end.unwrap_or(buffer.len())];
        let room = bytes_max - line.len();
        cut |= part.len() > room;
        line.extend_from_slice(&part[..part.len().min(room)]);
        let consumed = part.len() + usize::from(end.is_some());
        reader.consume(consumed);
        if end.is_some() && !finish(&mut line, &mut cut) {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufReader, Cursor};

    use super::*;

    fn lines_of(text: &[u8], bytes_max: usize) -> Vec<String> {
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
        assert_eq!(lines_of(b"12345\n123456\n", 5), ["12345", "12345..."]);
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
