//! Text for people on terminals.

use std::io::IsTerminal;
use std::os::fd::AsFd;

/// Narrower terminals break words, as hardly any would fit.
const COLUMNS_MIN: usize = 20;

/// The text with line ends between words where the terminal would break a line within a word; as it is where the stream is no
/// terminal.
#[must_use]
pub fn fitted(text: &str, stream: &(impl AsFd + IsTerminal)) -> String {
    let size = stream
        .is_terminal()
        .then(|| rustix::termios::tcgetwinsize(stream));
    match size {
        Some(Ok(size)) if usize::from(size.ws_col) >= COLUMNS_MIN => {
            wrapped(text, size.ws_col.into())
        }
        _ => text.to_owned(),
    }
}

/// The text with line ends in place of spaces, so that no line is longer than a number of columns unless a word is. Lines that
/// fit, such as those of a table, stay as they are.
fn wrapped(text: &str, columns: usize) -> String {
    let mut lines = Vec::new();
    for line in text.split('\n') {
        if line.chars().count() <= columns {
            lines.push(line.to_owned());
            continue;
        }
        let indent: String = line.chars().take_while(|&symbol| symbol == ' ').collect();
        let mut current = String::new();
        for word in line.split(' ').filter(|word| !word.is_empty()) {
            let length = current.chars().count() + 1 + word.chars().count();
            if current.is_empty() {
                current = format!("{indent}{word}");
            } else if length <= columns {
                current.push(' ');
                current.push_str(word);
            } else {
                lines.push(std::mem::replace(&mut current, format!("{indent}{word}")));
            }
        }
        lines.push(current);
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn lines_end_between_words() {
        assert_eq!(wrapped("one two three", 8), "one two\nthree");
        assert_eq!(wrapped("  one two three", 9), "  one two\n  three");
        assert_eq!(wrapped("a  table  row", 13), "a  table  row");
        assert_eq!(wrapped("one unbreakable two", 5), "one\nunbreakable\ntwo");
        assert_eq!(wrapped("", 5), "");
    }
}
