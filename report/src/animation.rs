//! An animated picture: one SVG file that plays a formation in a loop.
//!
//! It holds no script and loads nothing, so it plays wherever a picture may stand, also within `<img>`. Everything that moves
//! is a CSS animation of the whole film's length; without animations, and for readers who asked for reduced motion, the
//! picture shows the end.

mod clock;
mod docks;

use std::fmt::Write as _;

use formation_event_log::Entry;
use formation_model::text::counted;
use formation_model::{FormationStage, ModulePhase};

use crate::drawing::{self, rectangle, translate};
use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::page::places;
use crate::palette::look;
use crate::pictures::STYLE;
use crate::playback::{Film, Keyframe, ModuleFilm};
use crate::subject::Subject;
use clock::Clock;

const MOTION_STYLE: &str = include_str!("../assets/animation.css");
/// Where the rules of a style sheet for dark surroundings begin.
const DARK: &str = "@media (prefers-color-scheme: dark) {";

/// The approximate maximum of keyframes of all modules, which keeps the picture under a megabyte.
const KEYFRAMES_MAX: usize = 4_000;
/// The height of the caption above the ground, and of the progress bar below it.
const CAPTION: f64 = 44.0;
const PROGRESS: f64 = 5.0;
/// The margin around everything.
const MARGIN: f64 = 8.0;

/// The colours of an animated picture. Pages that follow the reader's colour scheme show one of the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colours {
    /// For a light page.
    Light,
    /// For a dark page.
    Dark,
}

/// Makes the animated picture of a formation that took this course; `outcome` is its last caption.
#[must_use]
pub fn animation(subject: &Subject, course: &[Entry], outcome: &str, colours: Colours) -> String {
    let frame = Frame::around(places(subject, course)).with_bodies(subject.surroundings.body());
    let film = Film::of(subject, course, &frame, outcome, KEYFRAMES_MAX);
    let clock = Clock::of(&film);
    let mut rules = styles(colours);
    let _ = write!(rules, "*{{animation-duration:{}s}}", clock.seconds());

    let mut ground = Element::group("ground")
        .with("transform", translate(MARGIN, CAPTION))
        .containing(rectangle("floor", frame.width, frame.height).with("rx", 6))
        .containing(grid(&frame))
        .containing(drawing::target(&frame, subject, |_| "spot"));
    ground.push(claims(subject, &film, &frame, &clock, &mut rules));
    ground.push(modules(subject, &film, &frame, &clock, &mut rules));
    ground.push(docks::drawn(&film, &frame, &clock, &mut rules));
    ground.push(
        Element::new("g")
            .with("transform", translate(0.0, frame.height + 6.0))
            .containing(rectangle("progress", frame.width, PROGRESS)),
    );

    let captions = captions(subject, &film, outcome, &clock, &mut rules);
    let (width, height) = (
        frame.width + 2.0 * MARGIN,
        CAPTION + frame.height + 6.0 + PROGRESS + MARGIN,
    );
    let title = format!("{}: {outcome}", subject.title());
    let picture = Element::new("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("viewBox", format!("0 0 {} {}", Short(width), Short(height)))
        .lengths([("width", width), ("height", height)])
        .with("role", "img")
        .with("aria-labelledby", "title")
        .containing(Element::new("title").with("id", "title").saying(&title))
        .containing(Element::new("style").saying(&rules))
        .containing(drawing::patterns())
        .containing(captions)
        .containing(ground);
    format!("{picture}\n")
}

/// The style of the pictures in one colour scheme, and what an animation adds.
fn styles(colours: Colours) -> String {
    [STYLE, MOTION_STYLE]
        .map(|sheet| {
            let (light, dark) = sheet.split_once(DARK).unwrap_or((sheet, ""));
            match colours {
                Colours::Light => light.to_owned(),
                Colours::Dark => {
                    let dark = dark.trim_end().strip_suffix('}').unwrap_or(dark);
                    format!("{light}{dark}")
                }
            }
        })
        .concat()
        .replace('\n', "")
}

/// The lines of the lattice, without numbers.
fn grid(frame: &Frame) -> Element {
    let mut grid = Element::group("grid");
    let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
        Element::new("line").lengths([("x1", x1), ("y1", y1), ("x2", x2), ("y2", y2)])
    };
    let columns = frame.columns().into_iter();
    grid.extend(columns.map(|column| line(column.at, 0.0, column.at, frame.height)));
    let rows = frame.rows().into_iter();
    grid.extend(rows.map(|row| line(0.0, row.at, frame.width, row.at)));
    grid
}

/// What each stage of the film is about, one caption at a time.
fn captions(
    subject: &Subject,
    film: &Film,
    outcome: &str,
    clock: &Clock,
    rules: &mut String,
) -> Element {
    let mut captions = Element::group("captions").with("transform", translate(MARGIN, 28.0));
    let mut stages = film.stages.iter().peekable();
    let mut number = 0;
    while let Some(&(from, stage)) = stages.next() {
        let until = stages.peek().map(|&&(next, _)| next);
        number += 1;
        let text = match stage {
            FormationStage::WaitingForTarget | FormationStage::Gathering => {
                let modules = counted(subject.modules.len(), "module");
                format!("{modules}: each reports where it stands")
            }
            FormationStage::Planning => "Each group claims its spots in turn".to_owned(),
            FormationStage::Agreeing => "All check that they hold the same plan".to_owned(),
            FormationStage::Acting => "They move at the same time, and dock".to_owned(),
            FormationStage::Done => outcome.to_owned(),
        };
        let mut caption = Element::group("caption").with("id", format!("c{number}"));
        if until.is_some() {
            caption = caption.with("opacity", 0);
        }
        captions.push(caption.containing(Element::new("text").saying(text)));
        clock.switch(rules, &format!("#c{number}"), &[(from, until)], false);
    }
    captions
}

/// The spots in the colour of the module that claimed them, with a line to it until it sets off.
fn claims(
    subject: &Subject,
    film: &Film,
    frame: &Frame,
    clock: &Clock,
    rules: &mut String,
) -> Element {
    let mut claims = Element::group("claims");
    let mut number = 0;
    for (position, spot) in film.spots.iter().enumerate() {
        let mut holders = spot.holders.iter().peekable();
        while let Some(&(from, holder)) = holders.next() {
            let until = holders.peek().map(|&&(next, _)| next);
            let Some(module) = holder else { continue };
            number += 1;
            let (played, pose) = (&film.modules[module], &subject.spots[position].pose);
            let at = pose_at(played.track.keyframes(), from);
            let colour = look(subject.modules[module].configuration).fill;
            let (x, y) = (frame.x(pose), frame.y(pose));
            let lengths = [("x1", at.1), ("y1", at.2), ("x2", x), ("y2", y)];
            let line = Element::new("line")
                .with("id", format!("g{number}"))
                .with("class", "goal")
                .with("stroke", colour)
                .with("opacity", 0)
                .lengths(lengths);
            let side = frame.module_side();
            let turned = format!("{} rotate({})", translate(x, y), Short(Frame::turn(pose)));
            let mut tint = rectangle("tint", side, side)
                .with("id", format!("s{number}"))
                .lengths([("x", -side / 2.0), ("y", -side / 2.0), ("rx", side * 0.18)])
                .with("fill", colour)
                .with("transform", turned);
            if until.is_some() {
                tint = tint.with("opacity", 0);
            }
            claims.extend([tint, line]);
            let sets_off = sets_off(played, from);
            let line_ends = [until, sets_off].into_iter().flatten();
            let line_ends = line_ends.fold(film.length, f64::min);
            clock.switch(
                rules,
                &format!("#g{number}"),
                &[(from, Some(line_ends))],
                false,
            );
            clock.switch(rules, &format!("#s{number}"), &[(from, until)], false);
        }
    }
    claims
}

/// When a module begins to move after a time.
fn sets_off(module: &ModuleFilm, after: f64) -> Option<f64> {
    let moves = |&&(at, phase): &&(f64, ModulePhase)| at >= after && phase == ModulePhase::Moving;
    module.phases.iter().find(moves).map(|&(at, _)| at)
}

/// The modules where they end, with the animations that bring them there.
fn modules(
    subject: &Subject,
    film: &Film,
    frame: &Frame,
    clock: &Clock,
    rules: &mut String,
) -> Element {
    let mut modules = Element::group("modules");
    for (module, played) in subject.modules.iter().zip(&film.modules) {
        modules.push(drawing::module_at(frame, module, &module.end));
        let keyframes = played.track.keyframes();
        let id = played.id;
        clock.path(
            rules,
            &format!("[data-module=\"{id}\"]"),
            &format!("m{id}"),
            keyframes.iter().map(|at| {
                (
                    at.0,
                    format!("translate({}px,{}px)", Short(at.1), Short(at.2)),
                )
            }),
        );
        let mut turn = Turn::default();
        clock.path(
            rules,
            &format!("[data-module=\"{id}\"] .body"),
            &format!("r{id}"),
            keyframes
                .iter()
                .map(|at| (at.0, format!("rotate({}deg)", Short(turn.follow(at.3))))),
        );
    }
    modules
}

/// An angle that follows others the shorter way round, in degrees.
#[derive(Default)]
struct Turn(Option<f64>);

impl Turn {
    fn follow(&mut self, angle: f64) -> f64 {
        let next = match self.0 {
            None => angle,
            Some(last) => last + ((angle - last) % 360.0 + 540.0) % 360.0 - 180.0,
        };
        self.0 = Some(next);
        next
    }
}

/// Where a track is at a time.
fn pose_at(keyframes: &[Keyframe], time: f64) -> Keyframe {
    let next = keyframes.partition_point(|at| at.0 <= time);
    match (
        next.checked_sub(1).map(|before| keyframes[before]),
        keyframes.get(next),
    ) {
        (Some(from), Some(to)) => {
            let share = (time - from.0) / (to.0 - from.0);
            let between = |from: f64, to: f64| from + (to - from) * share;
            Keyframe(time, between(from.1, to.1), between(from.2, to.2), from.3)
        }
        (Some(last), None) => last,
        (None, Some(first)) => *first,
        (None, None) => Keyframe(time, 0.0, 0.0, 0.0),
    }
}
