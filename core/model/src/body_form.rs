//! What bodies cover where they stand, and on their way.

use crate::turning::off_quarter;
use crate::{Area, BODY_WIDTH, MICRO_PER_UNIT, MicroUnits, Pose, Target, polyline};

/// A longer path of a body stands for the rectangles around its lines: 1,000 units.
const PATH_SAMPLED_MAX: MicroUnits = MicroUnits(1_000 * MICRO_PER_UNIT);

/// When there are as many obstacles, the paths of further bodies do, too.
const AREAS_SAMPLED_MAX: usize = 1 << 17;

/// A body that is turned against the axes by no more, in microradians, stands along them.
const ALONG_AXES: i64 = 2_000;

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
            false if off_quarter(pose.theta.0).abs() <= ALONG_AXES => {
                vec![Area::of_body(pose, self.width)]
            }
            false => Area::of_turned_body(pose, self.width),
        }
    }

    /// What a body may cover that is at a pose or on the way through several, in rectangles; in few if `known` others are many.
    ///
    /// On its way it is not where its body would overlap those of `others`, which are measured: it has
    /// passed there, or has not come there yet.
    pub fn areas(self, path: &[Pose], known: usize, others: &[Pose]) -> Vec<Area> {
        if let [pose] = path {
            return self.standing(pose);
        }
        let spacing = MicroUnits(MICRO_PER_UNIT / 2);
        // What a report says cannot make a plan take more memory than there is.
        let is_sampled = polyline::length(path) <= PATH_SAMPLED_MAX && known < AREAS_SAMPLED_MAX;
        let lines = polyline::lines(path);
        if is_sampled {
            // Bodies of any heading overlap if they are nearer than their width.
            let areas = lines.flat_map(|ends| {
                let parts = polyline::parts_away_from(ends, others, self.width).into_iter();
                parts.flat_map(move |part| Area::along_line(ends, part, self.width, spacing))
            });
            areas.collect()
        } else {
            let around = lines.map(|ends| Area::around_line(ends, self.width));
            around.collect()
        }
    }
}
