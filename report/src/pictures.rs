//! The pictures before and after, each a file of its own.

use std::fmt::Write;

use formation::model::Pose;
use formation::model::text::counted;

use crate::drawing::{self, BELOW, LEFT};
use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::legend::{self, Entry, Mark};
use crate::subject::Subject;

/// What the pictures look like, in light and in dark surroundings.
pub(crate) const STYLE: &str = include_str!("../assets/picture.css");

/// Above the ground: the title and a line on what there is to see.
const HEAD: f64 = 62.0;
const RIGHT: f64 = 18.0;
/// The title and the legend need so much.
const GROUND_WIDTH_MIN: f64 = 460.0;

/// The modules where they start, their links, and the spots that they are to fill.
#[must_use]
pub fn before(subject: &Subject) -> String {
    let starts = subject.modules.iter().map(|module| module.start);
    let spots = subject.spots.iter().map(|spot| spot.pose);
    let frame = Frame::around(starts.chain(spots)).at_least(GROUND_WIDTH_MIN);
    let broken = subject.links.len() - subject.kept_links();
    let subtitle = format!(
        "before: {}, {} to fill; {}, {} of them to break",
        counted(subject.modules.len(), "module"),
        counted(subject.spots.len(), "spot"),
        counted(subject.links.len(), "link"),
        if broken == 0 {
            "none".to_owned()
        } else {
            broken.to_string()
        },
    );
    let mut ground = vec![drawing::target(&frame, subject, |_| "spot")];
    let start = |module: usize| &subject.modules[module].start;
    ground.push(kept_links(&frame, subject, start));
    let (bows, crosses) = broken_links(&frame, subject, start);
    ground.push(bows);
    ground.extend(
        subject
            .modules
            .iter()
            .map(|module| drawing::module_at(&frame, module, &module.start)),
    );
    ground.push(crosses);
    let mut entries = legend::of_modules(subject);
    entries.push(Entry::new(Mark::Spot, "spot to fill"));
    if subject.kept_links() > 0 {
        entries.push(Entry::new(Mark::Line("link kept"), "link that is kept"));
    }
    if broken > 0 {
        entries.push(Entry::new(Mark::Break, "link that breaks"));
    }
    picture(subject, &frame, &subtitle, ground, &entries)
}

/// The modules where they end, what became of their links, and the spots that are left open.
#[must_use]
pub fn after(subject: &Subject) -> String {
    let ends = subject.modules.iter().map(|module| module.end);
    let spots = subject.spots.iter().map(|spot| spot.pose);
    let frame = Frame::around(ends.chain(spots)).at_least(GROUND_WIDTH_MIN);
    let kept = subject.kept_links();
    let broken = subject.links.len() - kept;
    let subtitle = format!(
        "after: {} of {} filled; {} kept, {broken} broken, {} new",
        subject.filled_spots(),
        counted(subject.spots.len(), "spot"),
        counted(kept, "link"),
        subject.new_links.len(),
    );
    let mut ground = vec![drawing::target(&frame, subject, |spot| {
        if spot.holder.is_some() {
            "spot"
        } else {
            "spot open"
        }
    })];
    let mut new_links = Element::group("links");
    new_links.extend(subject.new_links.iter().map(|&(one, other)| {
        let (one, other) = (&subject.modules[one].end, &subject.modules[other].end);
        drawing::line(&frame, "link new", one, other)
    }));
    ground.push(new_links);
    let end = |module: usize| &subject.modules[module].end;
    ground.push(kept_links(&frame, subject, end));
    let (bows, crosses) = broken_links(&frame, subject, end);
    ground.push(bows);
    ground.extend(
        subject
            .modules
            .iter()
            .map(|module| drawing::module_at(&frame, module, &module.end)),
    );
    ground.push(crosses);
    let mut entries = legend::of_modules(subject);
    if kept > 0 {
        entries.push(Entry::new(Mark::Line("link kept"), "kept link"));
    }
    if broken > 0 {
        entries.push(Entry::new(Mark::Break, "broken link"));
    }
    if !subject.new_links.is_empty() {
        entries.push(Entry::new(Mark::Line("link new"), "new link"));
    }
    if subject.filled_spots() < subject.spots.len() {
        entries.push(Entry::new(Mark::OpenSpot, "open spot"));
    }
    picture(subject, &frame, &subtitle, ground, &entries)
}

/// The initial links that are kept.
fn kept_links<'a>(frame: &Frame, subject: &Subject, pose: impl Fn(usize) -> &'a Pose) -> Element {
    let mut group = Element::group("links");
    let links = subject.links.iter().filter(|link| link.kept);
    group.extend(
        links.map(|link| drawing::line(frame, "link kept", pose(link.ends.0), pose(link.ends.1))),
    );
    group
}

/// The broken links: their bows, which pass under the modules, and crosses upon all.
fn broken_links<'a>(
    frame: &Frame,
    subject: &Subject,
    pose: impl Fn(usize) -> &'a Pose,
) -> (Element, Element) {
    let (mut bows, mut crosses) = (Element::group("links"), Element::group("links"));
    for link in subject.links.iter().filter(|link| !link.kept) {
        let (bow, cross) = drawing::broken(frame, pose(link.ends.0), pose(link.ends.1));
        bows.push(bow);
        crosses.push(cross);
    }
    (bows, crosses)
}

fn picture(
    subject: &Subject,
    frame: &Frame,
    subtitle: &str,
    ground: Vec<Element>,
    entries: &[Entry],
) -> String {
    let width = LEFT + frame.width + RIGHT;
    let (legend, legend_height) = legend::draw(entries, frame, width - 2.0 * legend::INSET);
    let legend_top = HEAD + frame.height + BELOW;
    let height = legend_top + legend_height + legend::INSET;
    let mut root = Element::new("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("viewBox", format!("0 0 {} {}", Short(width), Short(height)))
        .with("width", Short(width))
        .with("height", Short(height))
        .with("role", "img")
        .containing(Element::new("title").saying(format!("{}, {subtitle}", subject.title())))
        .containing(Element::new("style").saying(""))
        .containing(drawing::patterns())
        .containing(
            Element::new("rect")
                .with("class", "paper")
                .with("width", Short(width))
                .with("height", Short(height)),
        )
        .containing(
            Element::new("text")
                .with("class", "title")
                .with("x", legend::INSET)
                .with("y", 28)
                .saying(cut(subject.title(), width - 2.0 * legend::INSET, 19.0)),
        )
        .containing(
            Element::new("text")
                .with("class", "subtitle")
                .with("x", legend::INSET)
                .with("y", 49)
                .saying(cut(subtitle, width - 2.0 * legend::INSET, 13.0)),
        );
    let mut drawn = Element::group("ground").with("transform", format!("translate({LEFT} {HEAD})"));
    drawn.push(
        Element::new("rect")
            .with("class", "floor")
            .with("width", Short(frame.width))
            .with("height", Short(frame.height)),
    );
    drawn.push(drawing::grid(frame));
    drawn.extend(ground);
    root.push(drawn);
    root.push(legend.with(
        "transform",
        format!("translate({} {})", legend::INSET, Short(legend_top)),
    ));
    // The style sheet is ours and holds signs that text must not.
    let mut text = String::new();
    let _ = write!(text, "{root}");
    text.replacen("<style></style>", &format!("<style>{STYLE}</style>"), 1)
}

/// Text that is no wider than `width`, in letters of this size and about as wide as those of common fonts.
fn cut(text: &str, width: f64, size: f64) -> String {
    let mut left = width - size;
    let mut end = text.len();
    for (index, letter) in text.char_indices() {
        left -= size
            * match letter {
                'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.95,
                letter if letter.is_ascii_uppercase() => 0.75,
                letter if letter.is_ascii() => 0.62,
                _ => 1.05,
            };
        if left < 0.0 {
            end = end.min(index);
        }
    }
    if left >= 0.0 {
        text.to_owned()
    } else {
        format!("{}…", &text[..end])
    }
}
