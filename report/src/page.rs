//! The page that plays a formation: one file that needs no network.

use std::fmt::Display;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use formation_event_log::{Entry, LogEvent};
use formation_model::Pose;
use formation_model::text::counted;
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::drawing::{self, BELOW, LEFT};
use crate::element::{Element, Escaped, Short};
use crate::frame::Frame;
use crate::legend::{self, Mark};
use crate::pictures::STYLE;
use crate::playback::{Film, KEYFRAMES_MAX};
use crate::subject::{Module, Subject};

const TEMPLATE: &str = include_str!("../assets/page.html");
const PAGE_STYLE: &str = include_str!("../assets/page.css");
/// One script: the film and the player, which the studio uses too, and the picture of this page.
const PLAYER: &str = concat!(
    include_str!("../player/film.js"),
    include_str!("../player/player.js"),
    include_str!("../assets/picture.js"),
);

/// The minimum width of the ground, for small formations.
const GROUND_WIDTH_MIN: f64 = 300.0;
const ABOVE: f64 = 10.0;
const RIGHT: f64 = 12.0;

/// How a page presents the outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// The formation did what it was to do.
    Good,
    /// The formation failed, or was found wrong.
    Bad,
    /// Nothing was carried out.
    Neutral,
}

/// A number with its name and its unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fact {
    /// The quantity.
    pub name: &'static str,
    /// The number with its unit.
    pub value: String,
}

impl Fact {
    /// A number; `value` includes its unit.
    #[must_use]
    pub fn new(name: &'static str, value: impl Display) -> Self {
        Self {
            name,
            value: value.to_string(),
        }
    }
}

/// The content of a page other than the film.
#[derive(Clone, Debug)]
pub struct Summary {
    /// One sentence on the outcome, such as the verdict.
    pub outcome: String,
    /// The presentation of the outcome.
    pub tone: Tone,
    /// The origin of the film, planned or recorded, and the meaning of its time.
    pub source: String,
    /// The numbers.
    pub facts: Vec<Fact>,
    /// Further notes, such as warnings and violations.
    pub notes: Vec<String>,
}

/// Makes the page of a formation that took this course.
#[must_use]
pub fn page(subject: &Subject, course: &[Entry], summary: &Summary) -> String {
    let frame = Frame::around(places(subject, course))
        .at_least(GROUND_WIDTH_MIN)
        .with_bodies(subject.surroundings.body());
    let film = Film::of(subject, course, &frame, &summary.outcome, KEYFRAMES_MAX);
    fill(TEMPLATE, |marker| match marker {
        "policy" => policy(),
        "title" => Escaped(subject.title()).to_string(),
        "style" => format!("{STYLE}{PAGE_STYLE}"),
        "tone" => match summary.tone {
            Tone::Good => "good",
            Tone::Bad => "bad",
            Tone::Neutral => "neutral",
        }
        .to_owned(),
        "outcome" => Escaped(&summary.outcome).to_string(),
        "source" => Escaped(&summary.source).to_string(),
        "picture" => stage(subject, &frame).to_string(),
        "legend" => all(legend_of(subject)),
        "step-count" => film.steps.len().to_string(),
        "facts" => all(summary.facts.iter().map(row_of)),
        "notes" => notes(&summary.notes),
        "notes-link" => notes_link(&summary.notes),
        "modules" => all(subject
            .modules
            .iter()
            .map(|module| row_of_module(subject, module))),
        "film" => embedded(&film),
        "player" => PLAYER.to_owned(),
        // A test checks that the template has no other markers.
        _ => String::new(),
    })
}

fn all(elements: impl IntoIterator<Item = Element>) -> String {
    elements
        .into_iter()
        .map(|element| element.to_string())
        .collect()
}

/// Replaces each `{{marker}}` of a template once; markers in inserted content are not replaced.
fn fill(template: &str, content: impl Fn(&str) -> String) -> String {
    let mut page = String::with_capacity(template.len());
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        page.push_str(before);
        let Some((marker, after)) = after.split_once("}}") else {
            break;
        };
        page.push_str(&content(marker));
        rest = after;
    }
    page.push_str(rest);
    page
}

/// The content security policy: the page runs only its own script and loads nothing.
fn policy() -> String {
    let hash = BASE64_STANDARD.encode(Sha256::digest(PLAYER.as_bytes()));
    format!(
        "default-src 'none'; script-src 'sha256-{hash}'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
    )
}

/// JSON for a script element, with all characters escaped that could end the element.
fn embedded(value: &impl Serialize) -> String {
    let json = serde_json::to_string(value).unwrap_or_else(|_| "null".to_owned());
    let mut safe = String::with_capacity(json.len());
    for character in json.chars() {
        match character {
            '<' => safe.push_str("\\u003c"),
            '>' => safe.push_str("\\u003e"),
            '&' => safe.push_str("\\u0026"),
            '\u{2028}' => safe.push_str("\\u2028"),
            '\u{2029}' => safe.push_str("\\u2029"),
            _ => safe.push(character),
        }
    }
    safe
}

/// All poses in the film.
pub(crate) fn places<'a>(
    subject: &'a Subject,
    course: &'a [Entry],
) -> impl Iterator<Item = Pose> + 'a {
    let observed = course.iter().filter_map(|entry| match &entry.event {
        LogEvent::State(state) => Some((state.module, state.pose)),
        LogEvent::Pose { module, pose } => Some((*module, *pose)),
        _ => None,
    });
    let known = observed.filter(|&(module, _)| subject.position_of(module).is_some());
    let ends = subject
        .modules
        .iter()
        .flat_map(|module| [module.start, module.end]);
    ends.chain(subject.spots.iter().map(|spot| spot.pose))
        .chain(subject.corners())
        .chain(known.map(|(_, pose)| pose))
}

/// The ground at the start of the film; the player moves the elements on it.
fn stage(subject: &Subject, frame: &Frame) -> Element {
    let (width, height) = (LEFT + frame.width + RIGHT, ABOVE + frame.height + BELOW);
    let layer = |id| Element::new("g").with("id", id);
    let mut modules = layer("modules");
    let drawn = |module| drawing::module_at(frame, module, &module.start);
    modules.extend(subject.modules.iter().map(drawn));
    let mut ground = drawing::ground(frame, (LEFT, ABOVE));
    // Below the spots, so that no line crosses a number.
    ground.extend([layer("cells"), layer("trails"), layer("paths")]);
    ground.push(drawing::target(frame, subject, |_| "spot"));
    ground.extend([layer("links"), modules]);
    ground.extend([layer("crosses"), layer("marks")]);
    Element::new("svg")
        .with("id", "picture")
        .with("viewBox", format!("0 0 {} {}", Short(width), Short(height)))
        .with("role", "img")
        .with("aria-labelledby", "now")
        .containing(drawing::patterns())
        .containing(ground)
}

fn legend_of(subject: &Subject) -> Vec<Element> {
    let mut entries = legend::of_modules(subject);
    for (mark, text) in [
        (Mark::Line("link kept"), "link that is kept"),
        (Mark::Break, "link that breaks"),
        (Mark::Line("link new"), "new link"),
        (Mark::Line("path"), "path to the claimed spot"),
        (Mark::Line("claim"), "claims a spot, no path known"),
        (Mark::Ring("ring waiting"), "waits for others to pass"),
        (Mark::Ring("ring acting"), "acts in this step"),
        (Mark::Ring("ring evicted"), "loses its spot in this step"),
        (Mark::Spot, "free spot"),
        (Mark::ClaimedSpot, "claimed spot"),
    ] {
        entries.push((mark, text.to_owned()));
    }
    entries
        .into_iter()
        .map(|(mark, text)| {
            let mut item = Element::new("li");
            if !matches!(mark, Mark::None) {
                item.push(
                    Element::new("svg")
                        .with("class", "sign")
                        .with("viewBox", "-2 -12 32 24")
                        .with("aria-hidden", "true")
                        .containing(legend::drawn(mark)),
                );
            }
            item.saying(text)
        })
        .collect()
}

fn row_of(fact: &Fact) -> Element {
    Element::new("tr")
        .containing(Element::new("th").with("scope", "row").saying(fact.name))
        .containing(Element::new("td").saying(&fact.value))
}

fn notes(notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    let mut list = Element::new("ul")
        .with("class", "notes")
        .with("id", "notes");
    list.extend(notes.iter().map(|note| Element::new("li").saying(note)));
    list.to_string()
}

/// The notes are below the first screen, so that any number of them leaves the picture its room.
fn notes_link(notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    Element::new("a")
        .with("id", "to-notes")
        .with("href", "#notes")
        .saying(counted(notes.len(), "note"))
        .to_string()
}

fn row_of_module(subject: &Subject, module: &Module) -> Element {
    let spot = module.spot.map(|spot| &subject.spots[spot]);
    let distance = spot.map(|spot| module.start.distance_to(&spot.pose).to_units());
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    let mut group = match module.configuration {
        Some(configuration) => subject.configurations[configuration].label.clone(),
        None => "single".to_owned(),
    };
    if module.leads {
        group.push_str(", leads it");
    }
    let is_own = |end: usize| subject.modules[end].id == module.id;
    let broken = subject.links.iter().filter(|link| !link.kept);
    let broken = broken.filter(|link| is_own(link.ends.0) || is_own(link.ends.1));
    let start = (module.start.x.to_units(), module.start.y.to_units());
    let button = Element::new("button")
        .with("type", "button")
        .with("class", "pick")
        .with("aria-pressed", "false")
        .with(
            "aria-label",
            format!("Point out {} in the picture", module.id),
        )
        .saying(module.id.0);
    let mut row = Element::new("tr").with("data-row", module.id.0);
    row.push(Element::new("th").with("scope", "row").containing(button));
    row.extend(
        [
            group,
            format!("{:.1}, {:.1}", start.0, start.1),
            or_dash(spot.map(|spot| spot.id.0.to_string())),
            or_dash(distance.map(|distance| format!("{distance:.2}"))),
            or_dash(module.order.map(|order| order.to_string())),
            or_dash(module.moves_with.map(|lead| lead.0.to_string())),
            counted(broken.count(), "link"),
        ]
        .map(|cell| Element::new("td").saying(cell)),
    );
    row.containing(Element::new("td").with("class", "phase").saying(""))
}
