//! What the signs in a picture mean.

use formation::model::text::counted;

use crate::drawing::{self, body};
use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::palette::{Look, look};
use crate::subject::Subject;

/// Around the legend and the title.
pub(crate) const INSET: f64 = 18.0;

const ROW: f64 = 26.0;
const SIGN: f64 = 34.0;
const GAP: f64 = 22.0;
/// The width of a letter, on average; a little too much rather than too little.
const LETTER: f64 = 7.3;
/// More configurations than these are counted, not listed.
const CONFIGURATIONS_MAX: usize = 12;

/// A sign.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Mark {
    Module(Look, bool),
    Line(&'static str),
    /// A ring around a module.
    Ring(&'static str),
    /// A link that breaks.
    Break,
    Spot,
    OpenSpot,
    ClaimedSpot,
    None,
}

/// A sign and what it means.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) mark: Mark,
    pub(crate) text: String,
}

impl Entry {
    pub(crate) fn new(mark: Mark, text: impl Into<String>) -> Self {
        Self {
            mark,
            text: text.into(),
        }
    }
}

/// The looks of the modules that there are.
pub(crate) fn of_modules(subject: &Subject) -> Vec<Entry> {
    let shown = subject.configurations.len().min(CONFIGURATIONS_MAX);
    let mut entries: Vec<Entry> = subject.configurations[..shown]
        .iter()
        .enumerate()
        .map(|(position, configuration)| {
            Entry::new(
                Mark::Module(look(Some(position)), false),
                format!(
                    "{}, {}",
                    configuration.label,
                    counted(configuration.size, "module")
                ),
            )
        })
        .collect();
    let more = subject.configurations.len() - shown;
    if more > 0 {
        entries.push(Entry::new(
            Mark::None,
            format!("and {more} more configurations"),
        ));
    }
    let singles = subject
        .modules
        .iter()
        .filter(|module| module.configuration.is_none())
        .count();
    if singles > 0 {
        entries.push(Entry::new(
            Mark::Module(look(None), false),
            counted(singles, "single module"),
        ));
    }
    if !subject.configurations.is_empty() {
        entries.push(Entry::new(
            Mark::Module(look(Some(0)), true),
            "leads its configuration",
        ));
    }
    entries
}

/// Draws entries in columns that together are no wider than `width`, and a note below; returns the drawing and its
/// height.
#[expect(clippy::cast_precision_loss, reason = "a few entries of a few letters")]
pub(crate) fn draw(entries: &[Entry], frame: &Frame, width: f64) -> (Element, f64) {
    let needed = |entry: &Entry| SIGN + entry.text.chars().count() as f64 * LETTER;
    let widest = entries.iter().map(needed).fold(0.0, f64::max) + GAP;
    let columns = (1..=entries.len())
        .rev()
        .find(|&columns| columns as f64 * widest <= width + GAP)
        .unwrap_or(1);
    let mut group = Element::group("legend");
    for (index, entry) in entries.iter().enumerate() {
        let x = (index % columns) as f64 * widest;
        let y = row(index / columns);
        group.push(
            drawn(entry.mark).with("transform", format!("translate({} {})", Short(x), Short(y))),
        );
        group.push(text(x + SIGN, y, &entry.text));
    }
    let rows = entries.len().div_ceil(columns);
    let note = if frame.is_to_scale() {
        "The pointed side of a module is its front."
    } else {
        "Modules are drawn larger than they are."
    };
    group.push(text(0.0, row(rows), note));
    (group, row(rows) + ROW / 2.0)
}

/// The middle of a row.
#[expect(clippy::cast_precision_loss, reason = "a few rows")]
fn row(index: usize) -> f64 {
    (index as f64 + 0.5) * ROW
}

fn text(x: f64, y: f64, text: &str) -> Element {
    Element::new("text")
        .with("x", Short(x))
        .with("y", Short(y + 4.5))
        .saying(text)
}

/// A sign, as high as a row of text, from the origin to the right.
pub(crate) fn drawn(mark: Mark) -> Element {
    let side = 17.0;
    let square = |class: &str| {
        Element::group(class).containing(
            Element::new("rect")
                .with("x", 4)
                .with("y", -side / 2.0)
                .with("width", side)
                .with("height", side)
                .with("rx", 3),
        )
    };
    match mark {
        Mark::Module(look, leads) => {
            let class = if leads { "module leader" } else { "module" };
            Element::group("sign").containing(
                Element::group(class)
                    .with("transform", format!("translate({} 0)", 4.0 + side / 2.0))
                    .containing(body(side, &look, 0.0)),
            )
        }
        Mark::Line(class) => Element::group("sign").containing(
            Element::new("line")
                .with("class", class)
                .with("x1", 0)
                .with("x2", 26),
        ),
        Mark::Ring(class) => Element::group("sign").containing(
            Element::new("circle")
                .with("class", class)
                .with("cx", 4.0 + side / 2.0)
                .with("r", 9),
        ),
        Mark::Break => {
            let line = Element::new("line")
                .with("class", "link broken")
                .with("x1", 0)
                .with("x2", 26);
            Element::group("sign")
                .containing(line)
                .containing(drawing::cross(13.0, 0.0, 4.5))
        }
        Mark::Spot => Element::group("sign").containing(square("spot")),
        Mark::OpenSpot => Element::group("sign").containing(square("spot open")),
        Mark::ClaimedSpot => {
            Element::group("sign").containing(square("spot").with("data-state", "claimed"))
        }
        Mark::None => Element::group("sign"),
    }
}
