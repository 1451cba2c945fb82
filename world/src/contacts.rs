//! Contacts between bodies that are not docked: how many, how fast, how deep.

use std::collections::BTreeMap;
use std::time::Duration;

use formation_motion::WorldReport;
use rapier2d::geometry::{ContactPair, SolverFlags};
use rapier2d::math::{Real, Vector};
use rapier2d::pipeline::{PairFilterContext, PhysicsHooks, PhysicsWorld};

use crate::plane::real;

/// Bodies that have been apart for longer touch again, and it counts as another contact.
const APART: Duration = Duration::from_millis(250);

/// Contacts within a docked body are none: its modules are held by joints, and pass each other when they fold.
pub(crate) struct DockedBodies<'a>(pub &'a [usize]);

impl PhysicsHooks for DockedBodies<'_> {
    fn filter_contact_pair(&self, pair: &PairFilterContext) -> Option<SolverFlags> {
        let body = |handle| {
            let collider: &rapier2d::geometry::Collider = &pair.colliders[handle];
            module_of(collider.user_data).and_then(|module| self.0.get(module))
        };
        let is_docked =
            body(pair.collider1).is_some() && body(pair.collider1) == body(pair.collider2);
        (!is_docked).then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }
}

/// The mark of a module's collider.
pub(crate) fn mark_of(module: usize) -> u128 {
    module as u128 + 1
}

/// The module of a collider; `None` for obstacles and walls.
fn module_of(mark: u128) -> Option<usize> {
    usize::try_from(mark).ok()?.checked_sub(1)
}

/// How a body moves.
#[derive(Clone, Copy, Debug)]
struct Motion {
    centre: Vector,
    linear: Vector,
    angular: Real,
}

impl Motion {
    /// The velocity of the body's material at a point.
    fn at(&self, point: Vector) -> Vector {
        let arm = point - self.centre;
        self.linear + Vector::new(-arm.y, arm.x) * self.angular
    }
}

/// One contact that lasts.
#[derive(Clone, Copy, Debug)]
struct Touching {
    last: Duration,
    is_hard: bool,
}

/// Counts contacts.
#[derive(Debug, Default)]
pub(crate) struct Contacts {
    /// How each module moved before the step.
    motions: Vec<Motion>,
    touching: BTreeMap<(Option<usize>, Option<usize>), Touching>,
}

impl Contacts {
    /// Notes how modules move before the physics keeps bodies apart.
    pub fn note_motions(
        &mut self,
        physics: &PhysicsWorld,
        bodies: impl Iterator<Item = rapier2d::dynamics::RigidBodyHandle>,
    ) {
        self.motions.clear();
        self.motions.extend(bodies.map(|handle| {
            let body = &physics.bodies[handle];
            Motion {
                centre: body.translation(),
                linear: body.linvel(),
                angular: body.angvel(),
            }
        }));
    }

    /// Counts the contacts of the step that was done.
    pub fn count(&mut self, now: Duration, physics: &PhysicsWorld, report: &mut WorldReport) {
        for pair in physics.contact_pairs() {
            let [one, other] = [pair.collider1, pair.collider2]
                .map(|handle| module_of(physics.colliders[handle].user_data));
            let Some(meeting) = self.meeting(pair, [one, other], physics) else {
                continue;
            };
            let known = self.touching.get(&(one, other));
            let known = known.filter(|known| now.saturating_sub(known.last) <= APART);
            let is_new = known.is_none();
            let was_hard = known.is_some_and(|known| known.is_hard);
            let is_hard = was_hard
                || meeting.speed > WorldReport::TOUCH_SPEED
                || meeting.depth > WorldReport::TOUCH_DEPTH;
            let touching = Touching { last: now, is_hard };
            self.touching.insert((one, other), touching);
            if one.is_none() || other.is_none() {
                report.wall_contacts += u64::from(is_new);
                continue;
            }
            report.contacts += u64::from(is_new);
            report.contacts_above_touch += u64::from(is_hard && !was_hard);
            report.fastest_contact = report.fastest_contact.max(meeting.speed);
            report.deepest_overlap = report.deepest_overlap.max(meeting.depth);
        }
    }

    /// How two bodies meet; `None` if they do not touch.
    fn meeting(
        &self,
        pair: &ContactPair,
        modules: [Option<usize>; 2],
        physics: &PhysicsWorld,
    ) -> Option<Meeting> {
        let manifold = pair.manifolds().iter().max_by(|one, other| {
            let depth = |points: &[_]| deepest(points);
            depth(&one.points).total_cmp(&depth(&other.points))
        })?;
        let depth = deepest(&manifold.points);
        if depth < 0.0 && pair.total_impulse().length() <= real(1e-9) {
            return None;
        }
        let point = manifold.points.first()?;
        let at = physics.colliders[pair.collider1]
            .position()
            .transform_point(point.local_p1);
        let velocity = |module: Option<usize>| {
            let motion = module.and_then(|module| self.motions.get(module));
            motion.map_or(Vector::ZERO, |motion| motion.at(at))
        };
        let [one, other] = modules.map(velocity);
        let speed = (one - other).dot(manifold.data.normal).max(0.0);
        Some(Meeting {
            speed: speed.into(),
            depth: depth.max(0.0).into(),
        })
    }
}

/// How deep the deepest of some points of contact is; negative for a gap.
fn deepest(points: &[rapier2d::geometry::Contact]) -> Real {
    let depths = points.iter().map(|point| -point.dist);
    depths.fold(Real::NEG_INFINITY, Real::max)
}

/// How two bodies meet.
struct Meeting {
    /// The speed at which they come closer, in units a second.
    speed: f64,
    /// How deep they overlap, in units.
    depth: f64,
}
