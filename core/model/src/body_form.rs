//! What bodies cover where they stand, and on their way.

use crate::{Area, BODY_WIDTH, MICRO_PER_UNIT, MicroUnits, Pose, Target, polyline};

/// A longer path of a body stands for the rectangles around its lines: 1,000 units.
const PATH_SAMPLED_MAX: MicroUnits = MicroUnits(1_000 * MICRO_PER_UNIT);

/// When there are as many obstacles, the paths of further bodies do, too.
const AREAS_SAMPLED_MAX: usize = 1 << 17;

/// What the bodies of a formation cover.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyForm {
    width: MicroUnits,
    is_round: bool,
}

impl BodyForm {
    pub fn of(target: Option<&Target>) -> Self {
        let surroundings = target.map(Target::surroundings);
        Self {
            width: surroundings.map_or(BODY_WIDTH, |surroundings| surroundings.body_width()),
            is_round: surroundings.is_some_and(|surroundings| surroundings.body().is_round()),
        }
    }

    fn standing(self, pose: &Pose) -> Vec<Area> {
        match self.is_round {
            true => Area::of_round_body(pose, self.width),
            false => vec![Area::of_body(pose, self.width)],
        }
    }

    /// What a body may cover that is at a pose or on the way through several, in rectangles; in few if `known` others are many.
    pub fn areas(self, path: &[Pose], known: usize) -> Vec<Area> {
        if let [pose] = path {
            return self.standing(pose);
        }
        let spacing = MicroUnits(MICRO_PER_UNIT / 2);
        // What a report says cannot make a plan take more memory than there is.
        let is_sampled = polyline::length(path) <= PATH_SAMPLED_MAX && known < AREAS_SAMPLED_MAX;
        let lines = polyline::lines(path);
        if is_sampled {
            let sampled = lines.flat_map(|ends| Area::along_line(ends, self.width, spacing));
            sampled.collect()
        } else {
            let around = lines.map(|ends| Area::around_line(ends, self.width));
            around.collect()
        }
    }
}
