//! The links of an animated picture: a bar across the gap between two modules for as long as they are docked.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::clock::Clock;
use super::{Turn, pose_at};
use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::playback::{Fate, Film, Keyframe, Span};

/// Half the length of a bar, as a share of a module's side.
const HALF: f64 = 0.16;

/// All links with their animations. Without these, the picture shows the links of the end.
pub(super) fn drawn(film: &Film, frame: &Frame, clock: &Clock, rules: &mut String) -> Element {
    let mut docks = Element::group("docks");
    let half = HALF * frame.module_side();
    for (number, span) in film.links.iter().enumerate() {
        let class = match span.2 {
            Fate::Kept => "link kept",
            Fate::Broken => "link broken",
            Fate::New => "link new",
        };
        let path = path(film, span);
        let Some(last) = path.last() else { continue };
        let mut bar = Element::new("line")
            .with("id", format!("d{number}"))
            .with("class", class)
            .lengths([("x1", -half), ("x2", half)]);
        if span.4.is_some() {
            bar = bar.with("opacity", 0);
        }
        let place = format!(
            "translate({} {}) rotate({})",
            Short(last.1),
            Short(last.2),
            Short(last.3)
        );
        docks.push(
            Element::new("g")
                .with("id", format!("p{number}"))
                .with("transform", place)
                .containing(bar),
        );
        let is_broken = span.2 == Fate::Broken;
        clock.switch(
            rules,
            &format!("#d{number}"),
            &[(span.3, span.4)],
            is_broken,
        );
        let mut turn = Turn::default();
        clock.path(
            rules,
            &format!("#p{number}"),
            &format!("p{number}"),
            path.iter().map(|at| {
                let mut transform = String::new();
                let _ = write!(
                    transform,
                    "translate({}px,{}px) rotate({}deg)",
                    Short(at.1),
                    Short(at.2),
                    Short(turn.follow(at.3))
                );
                (at.0, transform)
            }),
        );
    }
    docks
}

/// The middle between two docked modules, and the direction from one to the other, at each time at which one of them turns off.
fn path(film: &Film, span: &Span) -> Vec<Keyframe> {
    let &Span(one, other, _, from, until) = span;
    let tracks = [one, other].map(|module| film.modules[module].track.keyframes());
    let until = until.unwrap_or(film.length);
    let inner = tracks.iter().flat_map(|track| track.iter());
    let inner = inner.map(|at| at.0).filter(|&at| from < at && at < until);
    // Times are whole milliseconds.
    #[expect(clippy::cast_possible_truncation, reason = "a film has a few minutes")]
    let times: BTreeSet<i64> = inner
        .chain([from, until])
        .map(|at| (at * 1_000.0).round() as i64)
        .collect();
    times
        .into_iter()
        .map(|millis| {
            #[expect(clippy::cast_precision_loss, reason = "a film has a few minutes")]
            let time = millis as f64 / 1_000.0;
            let [one, other] = tracks.map(|track| pose_at(track, time));
            let (dx, dy) = (other.1 - one.1, other.2 - one.2);
            let middle = ((one.1 + other.1) / 2.0, (one.2 + other.2) / 2.0);
            Keyframe(time, middle.0, middle.1, dy.atan2(dx).to_degrees())
        })
        .collect()
}
