//! A tree of SVG or HTML elements. Text is escaped, so no text can become markup.

use std::fmt::{self, Display, Write};

/// An element with its attributes and children.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<Child>,
}

#[derive(Clone, Debug)]
enum Child {
    Element(Element),
    Text(String),
}

impl Element {
    pub(crate) fn new(name: &'static str) -> Self {
        Self {
            name,
            attributes: Vec::new(),
            children: Vec::new(),
        }
    }

    /// A group of elements of one class.
    pub(crate) fn group(class: &str) -> Self {
        Self::new("g").with("class", class)
    }

    pub(crate) fn with(mut self, name: &'static str, value: impl Display) -> Self {
        self.attributes.push((name, value.to_string()));
        self
    }

    /// Adds attributes that are lengths in pixels.
    pub(crate) fn lengths<const N: usize>(self, lengths: [(&'static str, f64); N]) -> Self {
        let add = |element: Self, (name, length)| element.with(name, Short(length));
        lengths.into_iter().fold(self, add)
    }

    pub(crate) fn containing(mut self, child: Self) -> Self {
        self.push(child);
        self
    }

    pub(crate) fn saying(mut self, text: impl Display) -> Self {
        self.children.push(Child::Text(text.to_string()));
        self
    }

    pub(crate) fn push(&mut self, child: Self) {
        self.children.push(Child::Element(child));
    }

    pub(crate) fn extend(&mut self, children: impl IntoIterator<Item = Self>) {
        self.children
            .extend(children.into_iter().map(Child::Element));
    }
}

impl Display for Element {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "<{}", self.name)?;
        for (name, value) in &self.attributes {
            write!(formatter, " {name}=\"{}\"", Escaped(value))?;
        }
        if self.children.is_empty() {
            return formatter.write_str("/>");
        }
        formatter.write_char('>')?;
        for child in &self.children {
            match child {
                Child::Element(element) => element.fmt(formatter)?,
                Child::Text(text) => Escaped(text).fmt(formatter)?,
            }
        }
        write!(formatter, "</{}>", self.name)
    }
}

/// Text escaped for XML and HTML, between tags and in quoted attributes. Characters that XML does not allow, or that change
/// the writing direction, are replaced.
pub(crate) struct Escaped<'a>(pub &'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for character in self.0.chars() {
            match character {
                '&' => formatter.write_str("&amp;")?,
                '<' => formatter.write_str("&lt;")?,
                '>' => formatter.write_str("&gt;")?,
                '"' => formatter.write_str("&quot;")?,
                '\'' => formatter.write_str("&#39;")?,
                _ if is_unprintable(character) => formatter.write_char('\u{fffd}')?,
                _ => formatter.write_char(character)?,
            }
        }
        Ok(())
    }
}

fn is_unprintable(character: char) -> bool {
    character.is_control()
        || matches!(character,
            '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{fffe}' | '\u{ffff}')
}

/// A length or an angle with at most one decimal.
pub(crate) struct Short(pub f64);

impl Display for Short {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{:.1}", self.0);
        let text = text.strip_suffix(".0").unwrap_or(&text);
        formatter.write_str(if text == "-0" { "0" } else { text })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hostile_text_stays_text() {
        let element = Element::new("text")
            .with("class", "\"><script>")
            .saying("</text> & 'x'\u{1}\u{202e}");
        assert_eq!(
            element.to_string(),
            "<text class=\"&quot;&gt;&lt;script&gt;\">&lt;/text&gt; &amp; &#39;x&#39;\u{fffd}\u{fffd}</text>"
        );
    }

    #[test]
    fn lengths_are_short() {
        let written: Vec<String> = [1.0, -0.04, 2.25, -3.0]
            .map(|length| Short(length).to_string())
            .to_vec();
        assert_eq!(written, ["1", "0", "2.2", "-3"]);
    }
}
