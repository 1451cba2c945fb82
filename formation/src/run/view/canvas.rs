//! Lines that are drawn repeatedly at the same place.

use std::io::Write;

use ::console::measure_text_width;

/// Draws lines in place of those that it drew before. What stands above is left alone.
pub struct Canvas<W> {
    out: W,
    /// The widths of the lines on the terminal.
    drawn: Vec<usize>,
}

impl<W: Write> Canvas<W> {
    pub fn new(out: W) -> Self {
        Self {
            out,
            drawn: Vec::new(),
        }
    }

    /// Draws lines, each narrower than the terminal, which has this many columns.
    pub fn draw(&mut self, lines: &[String], columns: usize) {
        let mut text = self.rewind(columns);
        for line in lines {
            text.push_str(line);
            // Clears what an earlier line has left there.
            text.push_str("\x1b[K\n");
        }
        text.push_str("\x1b[J");
        self.drawn = lines.iter().map(|line| measure_text_width(line)).collect();
        self.write(&text);
    }

    /// Clears all that it drew.
    pub fn clear(&mut self, columns: usize) {
        if !self.drawn.is_empty() {
            let text = self.rewind(columns) + "\x1b[J";
            self.drawn.clear();
            self.write(&text);
        }
    }

    /// Moves the cursor to where the first line begins. A terminal that has become narrower than a line shows it in
    /// several rows.
    fn rewind(&self, columns: usize) -> String {
        let rows: usize = self
            .drawn
            .iter()
            .map(|width| width.div_ceil(columns.max(1)).max(1))
            .sum();
        if rows == 0 {
            String::new()
        } else {
            format!("\x1b[{rows}F")
        }
    }

    /// Errors are ignored: the terminal may be gone.
    fn write(&mut self, text: &str) {
        let _ = self
            .out
            .write_all(text.as_bytes())
            .and_then(|()| self.out.flush());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(draw: impl FnOnce(&mut Canvas<Vec<u8>>)) -> String {
        let mut canvas = Canvas::new(Vec::new());
        draw(&mut canvas);
        String::from_utf8(canvas.out).unwrap()
    }

    fn lines(lines: &[&str]) -> Vec<String> {
        lines.iter().map(|line| (*line).to_owned()).collect()
    }

    #[test]
    fn a_frame_takes_the_place_of_the_last() {
        let text = written(|canvas| {
            canvas.draw(&lines(&["one", "two"]), 80);
            canvas.draw(&lines(&["three"]), 80);
            canvas.clear(80);
            canvas.clear(80);
        });
        assert_eq!(
            text,
            "one\x1b[K\ntwo\x1b[K\n\x1b[J\x1b[2Fthree\x1b[K\n\x1b[J\x1b[1F\x1b[J"
        );
    }

    #[test]
    fn a_narrower_terminal_shows_a_line_in_several_rows() {
        let text = written(|canvas| {
            canvas.draw(&lines(&["\x1b[1mtwelve signs\x1b[0m", ""]), 80);
            canvas.draw(&lines(&[]), 5);
        });
        assert!(text.ends_with("\x1b[4F\x1b[J"), "{text:?}");
    }
}
