//! A row of pictures of a formation at moments of its motion, for papers.

use formation_event_log::Entry;

use crate::drawing::{self, rectangle, translate};
use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::page::places;
use crate::pictures::{style_place, styled};
use crate::playback::{Fate, Film, KEYFRAMES_MAX};
use crate::subject::Subject;

/// The most pictures in a row.
pub const PANELS_MAX: usize = 12;

/// The space between two pictures, and below them for their shares.
const GAP: f64 = 16.0;
const CAPTION: f64 = 26.0;

/// A row of pictures of a course, each at a share of the recorded time from the first motion to the end, in hundredths: 0 is the
/// start and 100 the end. Only the first [`PANELS_MAX`] are drawn.
#[must_use]
pub fn figure(subject: &Subject, course: &[Entry], percents: &[u32]) -> String {
    let frame = Frame::around(places(subject, course)).with_bodies(subject.surroundings.body());
    let film = Film::of(subject, course, &frame, "", KEYFRAMES_MAX);
    let mut row = Element::group("row");
    let mut left = GAP;
    for &percent in percents.iter().take(PANELS_MAX) {
        let time = film.moment(f64::from(percent.min(100)) / 100.0);
        let caption = Element::new("text")
            .with("class", "subtitle")
            .lengths([("x", frame.width / 2.0), ("y", frame.height + 18.0)])
            .with("text-anchor", "middle")
            .saying(format!("{} %", percent.min(100)));
        row.push(
            panel(subject, &film, &frame, time)
                .with("transform", translate(left, GAP))
                .containing(caption),
        );
        left += frame.width + GAP;
    }
    let (width, height) = (left, GAP + frame.height + CAPTION + GAP);
    let picture = Element::new("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("viewBox", format!("0 0 {} {}", Short(width), Short(height)))
        .lengths([("width", width), ("height", height)])
        .with("role", "img")
        .containing(Element::new("title").saying(subject.title()))
        .containing(style_place())
        .containing(drawing::patterns())
        .containing(rectangle("paper", width, height))
        .containing(row);
    styled(&picture)
}

/// The formation at a time of the film.
fn panel(subject: &Subject, film: &Film, frame: &Frame, time: f64) -> Element {
    let place = |module: usize| {
        let at = film.modules[module].track.at(time);
        ((at.1, at.2), at.3)
    };
    let mut links = Element::group("links");
    for span in &film.links {
        if span.3 <= time && span.4.is_none_or(|end| time < end) {
            let ((x1, y1), _) = place(span.0);
            let ((x2, y2), _) = place(span.1);
            let class = match span.2 {
                Fate::New => "link new",
                Fate::Kept | Fate::Broken => "link kept",
            };
            let ends = [("x1", x1), ("y1", y1), ("x2", x2), ("y2", y2)];
            links.push(Element::new("line").with("class", class).lengths(ends));
        }
    }
    let mut panel = Element::group("panel")
        .containing(rectangle("floor", frame.width, frame.height))
        .containing(drawing::target(frame, subject, |_| "spot"))
        .containing(links);
    panel.extend(
        subject
            .modules
            .iter()
            .enumerate()
            .map(|(position, module)| {
                let (place, turn) = place(position);
                drawing::module_in(frame, module, place, turn)
            }),
    );
    panel
}
