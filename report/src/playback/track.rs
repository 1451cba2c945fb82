//! The path of one module through the film.

use formation_model::{ModulePhase, Pose};
use serde::Serialize;

use crate::frame::Frame;

/// A keyframe between two others is left out if its distance from the straight line is at most this, in pixels.
const STRAIGHT: f64 = 0.5;
/// A point of a path is no corner if the next one is at most this far from the line through it, in pixels.
const CORNER: f64 = 0.15;
/// A module whose pose changes although it reported no motion stood still until this long ago, seconds.
const JUMP_S: f64 = 0.3;

/// Time, x, y and turn: seconds, pixels and degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Keyframe(
    pub(crate) f64,
    pub(crate) f64,
    pub(crate) f64,
    pub(crate) f64,
);

/// A corner of a path, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Corner(f64, f64);

/// The corners of a path, without the points that lie on the line between their neighbours.
pub(super) fn corners(frame: &Frame, path: &[Pose]) -> Vec<Corner> {
    let mut corners: Vec<Corner> = Vec::new();
    for pose in path {
        let next = Corner(pixel(frame.x(pose)), pixel(frame.y(pose)));
        if corners.last() == Some(&next) {
            continue;
        }
        if let [.., before, last] = corners.as_slice() {
            let (from, to) = (
                (last.0 - before.0, last.1 - before.1),
                (next.0 - last.0, next.1 - last.1),
            );
            let turn = from.0 * to.1 - from.1 * to.0;
            let ahead = from.0 * to.0 + from.1 * to.1;
            if ahead > 0.0 && turn.abs() <= CORNER * from.0.hypot(from.1) {
                corners.pop();
            }
        }
        corners.push(next);
    }
    corners
}

/// Keyframes in the order of time.
#[derive(Clone, Debug, Serialize)]
#[serde(transparent)]
pub(crate) struct Track {
    frames: Vec<Keyframe>,
    #[serde(skip)]
    most: usize,
}

impl Track {
    /// A module that stands at a pose from the beginning.
    pub(super) fn new(frame: &Frame, pose: &Pose, most: usize) -> Self {
        Self {
            frames: vec![keyframe(0.0, frame, pose)],
            most,
        }
    }

    /// The keyframes in the order of time; there is at least one.
    pub(crate) fn keyframes(&self) -> &[Keyframe] {
        &self.frames
    }

    /// The keyframe at a time, interpolated.
    pub(crate) fn at(&self, time: f64) -> Keyframe {
        let after = self.frames.partition_point(|frame| frame.0 <= time);
        let before = self.frames[after.saturating_sub(1)];
        let Some(&next) = self.frames.get(after).filter(|next| next.0 > before.0) else {
            return before;
        };
        let share = ((time - before.0) / (next.0 - before.0)).max(0.0);
        let between = |from: f64, to: f64| from + (to - from) * share;
        Keyframe(
            time,
            between(before.1, next.1),
            between(before.2, next.2),
            between(before.3, next.3),
        )
    }

    /// Takes the pose of a state, before which the module was in phase `was`.
    pub(super) fn stand_or_go(
        &mut self,
        now: f64,
        frame: &Frame,
        pose: &Pose,
        was: Option<ModulePhase>,
    ) {
        let next = keyframe(now, frame, pose);
        let Some(&last) = self.frames.last() else {
            return;
        };
        let stands = is_same_place(&last, &next);
        if was != Some(ModulePhase::Moving) && !stands && now - JUMP_S > last.0 {
            self.frames
                .push(Keyframe(time(now - JUMP_S), last.1, last.2, last.3));
        }
        // Where a motion begins and ends there is a keyframe, even if no pose between them is known.
        self.push(next, was == Some(ModulePhase::Moving) && !stands);
    }

    /// Takes a pose between the ends of a motion.
    pub(super) fn go_on(&mut self, now: f64, frame: &Frame, pose: &Pose) {
        self.push(keyframe(now, frame, pose), true);
    }

    fn push(&mut self, next: Keyframe, on_the_way: bool) {
        if let [.., before, last] = self.frames.as_slice()
            && (on_the_way && is_between(before, last, &next)
                || is_same_place(before, last) && is_same_place(last, &next))
        {
            self.frames.pop();
        }
        self.frames.push(next);
        if self.frames.len() > self.most {
            self.thin();
        }
    }

    /// Drops every other keyframe between the first and the last two.
    fn thin(&mut self) {
        let last = self.frames.len().saturating_sub(2);
        let mut index = 0;
        self.frames.retain(|_| {
            index += 1;
            index % 2 == 1 || index > last
        });
    }
}

fn keyframe(now: f64, frame: &Frame, pose: &Pose) -> Keyframe {
    Keyframe(
        time(now),
        pixel(frame.x(pose)),
        pixel(frame.y(pose)),
        pixel(Frame::turn(pose)),
    )
}

fn is_same_place(one: &Keyframe, other: &Keyframe) -> bool {
    (one.1 - other.1).abs().max((one.2 - other.2).abs()) < 0.05 && (one.3 - other.3).abs() < 0.05
}

/// Whether a keyframe can be interpolated from its neighbours.
fn is_between(before: &Keyframe, middle: &Keyframe, after: &Keyframe) -> bool {
    let whole = after.0 - before.0;
    if whole <= 0.0 {
        return false;
    }
    let share = (middle.0 - before.0) / whole;
    let off = |from: f64, at: f64, to: f64| (from + (to - from) * share - at).abs();
    off(before.1, middle.1, after.1) <= STRAIGHT
        && off(before.2, middle.2, after.2) <= STRAIGHT
        && off(before.3, middle.3, after.3) <= 2.0
}

/// A time, rounded to milliseconds.
pub(super) fn time(seconds: f64) -> f64 {
    (seconds * 1_000.0).round() / 1_000.0
}

/// A position or an angle, rounded to one decimal.
pub(super) fn pixel(pixels: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (pixels * 10.0).round() / 10.0 + 0.0
}
