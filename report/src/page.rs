//! The page that plays a formation: one file that needs no network.

use std::fmt::Display;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use formation::event_log::{Entry, Event};
use formation::model::Pose;
use formation::model::text::counted;
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::drawing::{self, BELOW, LEFT};
use crate::element::{Element, Escaped, Short};
use crate::frame::Frame;
use crate::legend::{self, Mark};
use crate::pictures::STYLE;
use crate::playback::Film;
use crate::subject::{Module, Subject};

const TEMPLATE: &str = include_str!("../assets/page.html");
const PAGE_STYLE: &str = include_str!("../assets/page.css");
const PLAYER: &str = include_str!("../assets/player.js");

/// The ground is at least so wide, so that small formations do not look lost.
const GROUND_WIDTH_MIN: f64 = 300.0;
const ABOVE: f64 = 10.0;
const RIGHT: f64 = 12.0;

/// Whether a formation did what it was to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// It did.
    Good,
    /// Something is wrong.
    Bad,
    /// Nothing was carried out.
    Neutral,
}

/// A number with its name and its unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fact {
    /// What was counted or measured.
    pub name: &'static str,
    /// How much, with its unit.
    pub value: String,
}

impl Fact {
    /// A number; `value` carries its unit.
    #[must_use]
    pub fn new(name: &'static str, value: impl Display) -> Self {
        Self {
            name,
            value: value.to_string(),
        }
    }
}

/// What a page says besides the film.
#[derive(Clone, Debug)]
pub struct Summary {
    /// One sentence on the outcome, such as the verdict.
    pub outcome: String,
    /// Whether that is good.
    pub tone: Tone,
    /// Where the film comes from: planned or recorded, and how its time is to be read.
    pub source: String,
    /// The numbers.
    pub facts: Vec<Fact>,
    /// What people should know besides, such as warnings and violations.
    pub notes: Vec<String>,
}

/// Makes the page of a formation that took this course.
#[must_use]
pub fn page(subject: &Subject, course: &[Entry], summary: &Summary) -> String {
    let frame = Frame::around(places(subject, course)).at_least(GROUND_WIDTH_MIN);
    let film = Film::of(subject, course, &frame, &summary.outcome);
    let steps = film.step_count();
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
        "legend" => legend_of(subject).iter().map(ToString::to_string).collect(),
        "step-count" => steps.to_string(),
        "facts" => summary
            .facts
            .iter()
            .map(|fact| row_of(fact).to_string())
            .collect(),
        "notes" => notes(&summary.notes),
        "modules" => subject
            .modules
            .iter()
            .map(|module| row_of_module(subject, module).to_string())
            .collect(),
        "film" => embedded(&film),
        "player" => PLAYER.to_owned(),
        // The template is ours; a test holds it to these.
        _ => String::new(),
    })
}

/// Replaces each `{{marker}}` of a template once; what is put in is not looked at again.
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

/// The page may run its own script and no other, and load nothing.
fn policy() -> String {
    let hash = BASE64_STANDARD.encode(Sha256::digest(PLAYER.as_bytes()));
    format!(
        "default-src 'none'; script-src 'sha256-{hash}'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
    )
}

/// JSON as it may stand in a script element: nothing in it can end that.
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

/// Every pose that the film shows.
fn places<'a>(subject: &'a Subject, course: &'a [Entry]) -> impl Iterator<Item = Pose> + 'a {
    let told = course.iter().filter_map(|entry| match &entry.event {
        Event::State(told) => Some((told.module, told.pose)),
        Event::Pose { module, pose } => Some((*module, *pose)),
        _ => None,
    });
    let known = told.filter(|&(module, _)| subject.position_of(module).is_some());
    let ends = subject
        .modules
        .iter()
        .flat_map(|module| [module.start, module.end]);
    ends.chain(subject.spots.iter().map(|spot| spot.pose))
        .chain(known.map(|(_, pose)| pose))
}

/// The ground at the start of the film; the player moves what is on it.
fn stage(subject: &Subject, frame: &Frame) -> Element {
    let (width, height) = (LEFT + frame.width + RIGHT, ABOVE + frame.height + BELOW);
    let mut ground = Element::group("ground")
        .with("transform", format!("translate({LEFT} {ABOVE})"))
        .containing(
            Element::new("rect")
                .with("class", "floor")
                .with("width", Short(frame.width))
                .with("height", Short(frame.height)),
        )
        .containing(drawing::grid(frame))
        .containing(drawing::target(frame, subject, |_| "spot"))
        .containing(Element::new("g").with("id", "goals"))
        .containing(Element::new("g").with("id", "links"));
    let mut modules = Element::new("g").with("id", "modules");
    modules.extend(
        subject
            .modules
            .iter()
            .map(|module| drawing::module_at(frame, module, &module.start)),
    );
    ground.push(modules);
    for id in ["crosses", "marks"] {
        ground.push(Element::new("g").with("id", id));
    }
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
        (Mark::Line("goal"), "way to the claimed spot"),
        (Mark::Ring("ring acting"), "acts in this step"),
        (Mark::Ring("ring evicted"), "loses its spot in this step"),
        (Mark::Spot, "free spot"),
        (Mark::ClaimedSpot, "claimed spot"),
    ] {
        entries.push(legend::Entry::new(mark, text));
    }
    entries
        .into_iter()
        .map(|entry| {
            let mut item = Element::new("li");
            if !matches!(entry.mark, Mark::None) {
                item.push(
                    Element::new("svg")
                        .with("class", "sign")
                        .with("viewBox", "-2 -12 32 24")
                        .with("aria-hidden", "true")
                        .containing(legend::drawn(entry.mark)),
                );
            }
            item.saying(entry.text)
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
    let mut list = Element::new("ul").with("class", "notes");
    list.extend(notes.iter().map(|note| Element::new("li").saying(note)));
    list.to_string()
}

fn row_of_module(subject: &Subject, module: &Module) -> Element {
    let spot = module.spot.map(|spot| &subject.spots[spot]);
    let way = spot.map(|spot| format!("{:.2}", module.start.distance_to(&spot.pose).to_units()));
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    let group = match module.configuration {
        Some(configuration) => subject.configurations[configuration].label.clone(),
        None => "single".to_owned(),
    };
    let broken = subject
        .links
        .iter()
        .filter(|link| {
            !link.kept
                && (subject.modules[link.ends.0].id == module.id
                    || subject.modules[link.ends.1].id == module.id)
        })
        .count();
    let mut row = Element::new("tr").with("data-row", module.id.0).containing(
        Element::new("th").with("scope", "row").containing(
            Element::new("button")
                .with("type", "button")
                .with("class", "pick")
                .with("aria-pressed", "false")
                .with(
                    "aria-label",
                    format!("Point out module {} in the picture", module.id.0),
                )
                .saying(module.id.0),
        ),
    );
    row.extend(
        [
            if module.leads {
                format!("{group}, leads it")
            } else {
                group
            },
            format!(
                "{:.1}, {:.1}",
                module.start.x.to_units(),
                module.start.y.to_units()
            ),
            or_dash(spot.map(|spot| spot.id.0.to_string())),
            or_dash(way),
            or_dash(module.order.map(|order| order.to_string())),
            or_dash(module.moves_with.map(|lead| lead.0.to_string())),
            counted(broken, "link"),
        ]
        .map(|cell| Element::new("td").saying(cell)),
    );
    row.containing(Element::new("td").with("class", "phase").saying(""))
}
