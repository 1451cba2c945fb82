//! The legend: the signs in a picture and their meaning.

use formation_model::BodyShape;
use formation_model::text::counted;

use crate::drawing::{self, body, translate};
use crate::element::Element;
use crate::frame::Frame;
use crate::palette::{Look, look};
use crate::subject::Subject;

/// The margin around the legend and the title.
pub(crate) const INSET: f64 = 18.0;

const ROW: f64 = 26.0;
const SIGN: f64 = 34.0;
const GAP: f64 = 22.0;
/// An upper estimate of the mean width of a letter.
const LETTER: f64 = 7.3;
/// Further configurations are counted and not listed.
const CONFIGURATIONS_MAX: usize = 12;

/// A sign.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Mark {
    Module(Look, bool),
    /// A module whose process died.
    Dead,
    Line(&'static str),
    /// A ring around a module.
    Ring(&'static str),
    /// A link that breaks.
    Break,
    Spot,
    Obstacle,
    OpenSpot,
    ClaimedSpot,
    None,
}

/// A sign and its meaning.
pub(crate) type Entry = (Mark, String);

/// The entries for the looks of modules.
pub(crate) fn of_modules(subject: &Subject) -> Vec<Entry> {
    let module = |configuration, leads| Mark::Module(look(configuration), leads);
    let configurations = subject.configurations.iter().enumerate();
    let mut entries: Vec<Entry> = configurations
        .take(CONFIGURATIONS_MAX)
        .map(|(position, configuration)| {
            let size = counted(configuration.size, "module");
            let text = format!("{}, {size}", configuration.label);
            (module(Some(position), false), text)
        })
        .collect();
    let more = subject.configurations.len() - entries.len();
    if more > 0 {
        let text = format!("and {more} more configurations");
        entries.push((Mark::None, text));
    }
    let modules = subject.modules.iter();
    let singles = modules.filter(|module| module.configuration.is_none());
    let singles = singles.count();
    if singles > 0 {
        let text = counted(singles, "single module");
        entries.push((module(None, false), text));
    }
    if !subject.configurations.is_empty() {
        let mark = module(Some(0), true);
        entries.push((mark, "leads its configuration".to_owned()));
    }
    if !subject.surroundings.obstacles().is_empty() {
        entries.push((Mark::Obstacle, "obstacle".to_owned()));
    }
    entries
}

/// Draws entries in columns with a total width of at most `width`, and a note below; returns the drawing and its height.
#[expect(clippy::cast_precision_loss, reason = "a few entries of a few letters")]
pub(crate) fn draw(entries: &[Entry], frame: &Frame, width: f64) -> (Element, f64) {
    let needed = |(_, text): &Entry| SIGN + text.chars().count() as f64 * LETTER;
    let widest = entries.iter().map(needed).fold(0.0, f64::max) + GAP;
    let columns = (1..=entries.len())
        .rev()
        .find(|&columns| columns as f64 * widest <= width + GAP)
        .unwrap_or(1);
    let mut group = Element::group("legend");
    for (index, (mark, meaning)) in entries.iter().enumerate() {
        let x = (index % columns) as f64 * widest;
        let y = row(index / columns);
        group.push(drawn(*mark).with("transform", translate(x, y)));
        group.push(text(x + SIGN, y, meaning));
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
        .lengths([("x", x), ("y", y + 4.5)])
        .saying(text)
}

/// A sign as high as a row of text, from the origin to the right.
pub(crate) fn drawn(mark: Mark) -> Element {
    let sign = Element::group("sign");
    let side = 17.0;
    let centre = 4.0 + side / 2.0;
    let line = |class| {
        Element::new("line")
            .with("class", class)
            .lengths([("x1", 0.0), ("x2", 26.0)])
    };
    let square = |group: Element| {
        let lengths = [
            ("x", 4.0),
            ("y", -side / 2.0),
            ("width", side),
            ("height", side),
        ];
        group.containing(Element::new("rect").lengths(lengths).with("rx", 3))
    };
    match mark {
        Mark::Module(look, leads) => {
            let class = if leads { "module leader" } else { "module" };
            let module = Element::group(class).with("transform", format!("translate({centre} 0)"));
            sign.containing(module.containing(body((side, BodyShape::Square), &look, 0.0)))
        }
        Mark::Dead => Element::group("dead").containing(drawn(Mark::Module(look(None), false))),
        Mark::Line(class) => sign.containing(line(class)),
        Mark::Ring(class) => sign.containing(
            Element::new("circle")
                .with("class", class)
                .lengths([("cx", centre), ("r", 9.0)]),
        ),
        Mark::Break => sign
            .containing(line("link broken"))
            .containing(drawing::cross(13.0, 0.0, 4.5)),
        Mark::Obstacle => sign.containing(square(Element::group("obstacles"))),
        Mark::Spot => sign.containing(square(Element::group("spot"))),
        Mark::OpenSpot => sign.containing(square(Element::group("spot open"))),
        Mark::ClaimedSpot => {
            let spot = Element::group("spot").with("data-state", "claimed");
            sign.containing(square(spot))
        }
        Mark::None => sign,
    }
}
