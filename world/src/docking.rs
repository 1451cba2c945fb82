//! Docking: attempts of modules to dock, and the joints between docked modules.

use std::collections::BTreeMap;
use std::f32::consts::FRAC_PI_2;
use std::time::Duration;

use formation_model::DockingRequest;
use rapier2d::dynamics::{
    FixedJointBuilder, ImpulseJointHandle, RigidBodyHandle, SpringCoefficients,
};
use rapier2d::math::{Pose, Real, Rotation, Vector};
use rapier2d::pipeline::PhysicsWorld;

use crate::plane::{Deviation, deviation};

/// An attempt to dock takes at least this long.
const ATTEMPT_MIN: Duration = Duration::from_millis(200);
/// An attempt that has not come within the tolerance by then has failed.
const ATTEMPT_MAX: Duration = Duration::from_millis(1_000);

/// Within this a port finds the other one, and pulls its module there.
pub(crate) const REACH: Deviation = Deviation {
    distance: 0.3,
    angle: 0.5,
};

/// Docked modules whose goals lie to each other otherwise than they are docked, by more than this, fold.
const FOLDED: Deviation = Deviation {
    distance: 0.1,
    angle: 0.1,
};
/// Goals of one step arrive within this.
const FOLDS_AFTER: Duration = Duration::from_millis(500);
/// A fold ends when the modules are as near to their new places as this.
const UNFOLDED: Deviation = Deviation {
    distance: 0.03,
    angle: 0.05,
};

/// Goals that lie to each other as neighbours on the lattice do, but for the errors of measured poses.
const ON_LATTICE: Deviation = Deviation {
    distance: 0.15,
    angle: 0.15,
};
/// Off the lattice, modules dock that are at most this many units apart.
const APART_MAX: Real = 2.0;

/// A joint yields a little, with this frequency in hertz.
const JOINT_FREQUENCY: Real = 30.0;

/// What a module does with its ports.
#[derive(Clone, Debug)]
pub(crate) struct Attempt {
    pub request: DockingRequest,
    pub stage: AttemptStage,
}

/// The progress of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AttemptStage {
    /// It goes on since then.
    Trying(Duration),
    /// It has failed; another one begins when the request repeats.
    Failed,
    /// It has succeeded.
    Done,
}

/// What has become of an attempt to dock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Contact {
    /// It takes more time.
    Pending,
    /// The ports are within the tolerance.
    Reached,
    /// They are not, and the time is up.
    Missed,
}

impl Contact {
    /// Judges an attempt that goes on since `since`, with the module off its place by `off`.
    pub fn judge(now: Duration, since: Duration, off: Deviation, tolerance: Deviation) -> Self {
        let lasted = now.saturating_sub(since);
        if lasted >= ATTEMPT_MIN && off.is_within(tolerance) {
            Self::Reached
        } else if lasted >= ATTEMPT_MAX {
            Self::Missed
        } else {
            Self::Pending
        }
    }
}

/// Where a module docks, as the other one sees it: on the nearest side, one unit away, with the nearest of the four headings. Where
/// their goals lie to each other otherwise, as spots off the lattice do, its ports are where the goals want them.
pub(crate) fn docking_place(relative: &Pose, goals: &Pose) -> Pose {
    let is_far = goals.translation.length() > APART_MAX;
    if is_far || deviation(goals, &side(goals)).is_within(ON_LATTICE) {
        side(relative)
    } else {
        *goals
    }
}

/// The side of the other module, in that module's frame.
fn side(relative: &Pose) -> Pose {
    let Vector { x, y } = relative.translation;
    let place = if x.abs() >= y.abs() {
        Vector::new(x.signum(), 0.0)
    } else {
        Vector::new(0.0, y.signum())
    };
    let quarters = (relative.rotation.angle() / FRAC_PI_2).round();
    Pose::from_parts(place, Rotation::new(quarters * FRAC_PI_2))
}

/// Two docked modules.
#[derive(Debug)]
struct Link {
    /// The place of the second module, as seen from the first.
    rest: Pose,
    /// `None` while they fold.
    joint: Option<ImpulseJointHandle>,
    /// Where their goals want the second module, and since when.
    wanted: Option<(Pose, Duration)>,
}

/// All links between modules, which are numbered. A link is named by its lower and its higher end.
#[derive(Debug, Default)]
pub(crate) struct Links {
    links: BTreeMap<(usize, usize), Link>,
    /// The lowest module of the docked body to which each module belongs.
    pub bodies: Vec<usize>,
    /// How often two docked modules began to fold.
    pub folds: u64,
}

/// What the physics knows of a module.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub body: RigidBodyHandle,
    pub goal: Pose,
}

impl Links {
    pub fn new(modules: usize) -> Self {
        Self {
            bodies: (0..modules).collect(),
            ..Self::default()
        }
    }

    pub fn are_docked(&self, one: usize, other: usize) -> bool {
        self.links.contains_key(&key(one, other))
    }

    /// Docks two modules. `rest` gives the place of the second module, as seen from the first, by where it is now.
    pub fn dock(
        &mut self,
        one: usize,
        other: usize,
        placed: &[Placed],
        physics: &mut PhysicsWorld,
        rest: impl Fn(&Pose) -> Pose,
    ) {
        let ends = key(one, other);
        let rest = rest(&relative(placed, ends, physics));
        let link = Link {
            rest,
            joint: Some(joint(placed, ends, &rest, physics)),
            wanted: None,
        };
        self.links.insert(ends, link);
        self.find_bodies();
    }

    /// Undocks two modules, if they are docked.
    pub fn undock(&mut self, one: usize, other: usize, physics: &mut PhysicsWorld) {
        let link = self.links.remove(&key(one, other));
        if let Some(joint) = link.and_then(|link| link.joint) {
            physics.remove_impulse_joint(joint);
        }
        self.find_bodies();
    }

    /// Lets docked modules fold whose goals lie to each other otherwise than they are docked, and joins them again where
    /// these goals want them.
    pub fn fold(&mut self, now: Duration, placed: &[Placed], physics: &mut PhysicsWorld) {
        for (&ends, link) in &mut self.links {
            let goal = placed[ends.0].goal.inv_mul(&placed[ends.1].goal);
            if deviation(&goal, &link.rest).is_within(FOLDED) {
                link.wanted = None;
            } else {
                let known = link.wanted.filter(|(known, _)| *known == goal);
                let (_, since) = *link.wanted.insert(known.unwrap_or((goal, now)));
                if now >= since + FOLDS_AFTER {
                    link.rest = goal;
                    link.wanted = None;
                    if let Some(joint) = link.joint.take() {
                        physics.remove_impulse_joint(joint);
                        self.folds += 1;
                    }
                }
            }
            if link.joint.is_none()
                && deviation(&relative(placed, ends, physics), &link.rest).is_within(UNFOLDED)
            {
                link.joint = Some(joint(placed, ends, &link.rest, physics));
            }
        }
    }

    fn find_bodies(&mut self) {
        let mut bodies: Vec<usize> = (0..self.bodies.len()).collect();
        for &(low, high) in self.links.keys() {
            let (kept, merged) = (bodies[low].min(bodies[high]), bodies[low].max(bodies[high]));
            for body in &mut bodies {
                if *body == merged {
                    *body = kept;
                }
            }
        }
        self.bodies = bodies;
    }
}

fn key(one: usize, other: usize) -> (usize, usize) {
    (one.min(other), one.max(other))
}

/// The second module as seen from the first.
fn relative(placed: &[Placed], (low, high): (usize, usize), physics: &PhysicsWorld) -> Pose {
    let at = |index: usize| *physics.bodies[placed[index].body].position();
    at(low).inv_mul(&at(high))
}

fn joint(
    placed: &[Placed],
    (low, high): (usize, usize),
    rest: &Pose,
    physics: &mut PhysicsWorld,
) -> ImpulseJointHandle {
    let joint = FixedJointBuilder::new()
        .local_frame1(*rest)
        .softness(SpringCoefficients::new(JOINT_FREQUENCY, 1.0))
        .contacts_enabled(false);
    physics.insert_impulse_joint(placed[low].body, placed[high].body, joint)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: Real, y: Real, theta: Real) -> Pose {
        Pose::new(Vector::new(x, y), theta)
    }

    fn is_near(one: &Pose, other: &Pose) -> bool {
        deviation(one, other).is_within(Deviation {
            distance: 1e-4,
            angle: 1e-4,
        })
    }

    #[test]
    fn a_module_docks_on_the_nearest_side_with_the_nearest_heading() {
        let other = pose(2.0, 1.0, FRAC_PI_2);
        for (module, place) in [
            (pose(2.9, 1.1, 0.1), pose(3.0, 1.0, 0.0)),
            (pose(2.1, 0.1, 1.5), pose(2.0, 0.0, FRAC_PI_2)),
            (pose(1.1, 1.0, -3.1), pose(1.0, 1.0, 2.0 * FRAC_PI_2)),
        ] {
            let goals = other.inv_mul(&place);
            let found = other * docking_place(&other.inv_mul(&module), &goals);
            assert!(is_near(&found, &place), "{found:?} is not {place:?}");
        }
    }

    #[test]
    fn off_the_lattice_modules_dock_as_their_goals_lie_to_each_other() {
        let goals = pose(0.5, 0.866, 0.0);
        let found = docking_place(&pose(0.52, 0.85, 0.01), &goals);
        assert!(is_near(&found, &goals), "{found:?}");
    }

    #[test]
    fn an_attempt_ends_by_tolerance_and_time() {
        let at = Duration::from_millis;
        let off = |distance, angle| Deviation { distance, angle };
        let tolerance = off(0.03, 0.03);
        for (lasted, off, contact) in [
            (100, off(0.0, 0.0), Contact::Pending),
            (200, off(0.02, 0.02), Contact::Reached),
            (900, off(0.04, 0.0), Contact::Pending),
            (1_000, off(0.0, 0.04), Contact::Missed),
        ] {
            let judged = Contact::judge(at(5_000 + lasted), at(5_000), off, tolerance);
            assert_eq!(judged, contact, "after {lasted} ms");
        }
    }
}
