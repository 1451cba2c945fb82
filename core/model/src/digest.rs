//! Digests by which agents compare plans; they are equal on every machine.

use sha2::{Digest as _, Sha256};

use crate::{
    Area, BodyReport, BodyShape, Decision, Digest, ModuleId, MotionPlan, NO_ID, PaperOptions,
    PlannerParameters, PlanningModule, PlanningProblem, Policy, Pose, Roster, Surroundings, Target,
    TargetAnnouncement, Voters,
};

/// Feeds numbers to SHA-256 in a fixed layout. The length of every list precedes it, so that different inputs never have
/// the same bytes.
struct Canonical(Sha256);

impl Canonical {
    fn new(domain: &str) -> Self {
        let mut hasher = Sha256::new();
        hasher.update(domain.as_bytes());
        hasher.update([0]);
        Self(hasher)
    }

    fn number(&mut self, number: u64) {
        self.0.update(number.to_le_bytes());
    }

    fn signed(&mut self, number: i64) {
        self.0.update(number.to_le_bytes());
    }

    fn length(&mut self, length: usize) {
        self.number(length as u64);
    }

    fn identifier(&mut self, identifier: Option<u32>) {
        self.number(u64::from(identifier.unwrap_or(NO_ID)));
    }

    fn pose(&mut self, pose: &Pose) {
        for coordinate in [pose.x, pose.y, pose.theta] {
            self.signed(coordinate.0);
        }
    }

    fn finish(self) -> Digest {
        let bytes = self.0.finalize();
        let mut first = [0; 8];
        first.copy_from_slice(&bytes[..8]);
        Digest(u64::from_le_bytes(first))
    }
}

fn put_parameters(canonical: &mut Canonical, parameters: &PlannerParameters) {
    put_policy(canonical, parameters.policy);
    canonical.number(parameters.order as u64);
    canonical.number(parameters.d_max.map_or(u64::MAX, u64::from));
    canonical.number(u64::from(parameters.exact_finish));
    for weight in [
        parameters.weights.loc(),
        parameters.weights.dock(),
        parameters.weights.undock(),
        parameters.cut_price.per_cut(),
        parameters.spread.per_unit(),
    ] {
        canonical.signed(weight.0);
    }
    canonical.number(u64::from(parameters.keep_all_spots));
    if parameters.policy == Policy::Paper {
        put_paper(canonical, &parameters.paper);
    }
}

/// A number for each policy that comes with the planner, and the name of one's own, which says the same in every build.
fn put_policy(canonical: &mut Canonical, policy: Policy) {
    canonical.number(match policy {
        Policy::Exact => 0,
        Policy::Paper => 1,
        Policy::Auction => 2,
        Policy::Hungarian => 3,
        Policy::Given => 4,
        Policy::Own(_) => 5,
    });
    if let Policy::Own(own) = policy {
        canonical.length(own.name().len());
        canonical.0.update(own.name().as_bytes());
    }
}

fn put_paper(canonical: &mut Canonical, options: &PaperOptions) {
    for reading in [
        options.fallback as u64,
        options.embedding as u64,
        options.evicted as u64,
        options.val as u64,
        options.acting as u64,
    ] {
        canonical.number(reading);
    }
    canonical.length(options.max());
}

fn put_announcement(canonical: &mut Canonical, announcement: &TargetAnnouncement) {
    let target = announcement.target.as_deref();
    put_target(canonical, &announcement.parameters, target);
}

fn put_target(canonical: &mut Canonical, parameters: &PlannerParameters, target: Option<&Target>) {
    put_parameters(canonical, parameters);
    let Some(target) = target else {
        canonical.number(0);
        return;
    };
    let surroundings = target.surroundings();
    let is_plain = *surroundings == Surroundings::default();
    // Each kind of target has a number of its own, so what follows is read in one way only.
    canonical.number(match surroundings.body() {
        BodyShape::Square if is_plain => 1,
        BodyShape::Square => 2,
        BodyShape::Circle => 3,
    });
    if !is_plain {
        canonical.signed(surroundings.body_width().0);
        let (obstacles, arena) = (surroundings.obstacles(), surroundings.arena());
        canonical.length(obstacles.len());
        canonical.number(u64::from(arena.is_some()));
        for Area { low, high } in obstacles.iter().chain(&arena) {
            for coordinate in [low.0, low.1, high.0, high.1] {
                canonical.signed(coordinate.0);
            }
        }
    }
    canonical.length(target.frame_id().len());
    canonical.0.update(target.frame_id().as_bytes());
    canonical.length(target.spots().len());
    for spot in target.spots() {
        canonical.identifier(Some(spot.id.0));
        canonical.pose(&spot.pose);
    }
    canonical.length(target.topology().edges().len());
    for &(first, second) in target.topology().edges() {
        canonical.length(first);
        canonical.length(second);
    }
    // The policy says whether one follows.
    if let Some(given) = target.given() {
        canonical.length(given.spots().len());
        for (module, spot) in given.spots() {
            canonical.identifier(Some(module.0));
            canonical.identifier(Some(spot.0));
        }
        canonical.length(given.detached().len());
        for module in given.detached() {
            canonical.identifier(Some(module.0));
        }
    }
}

fn put_placement(canonical: &mut Canonical, module: &PlanningModule) {
    canonical.pose(&module.pose);
    canonical.length(module.links.len());
    for link in &module.links {
        canonical.identifier(Some(link.0));
    }
    canonical.identifier(module.configuration.map(|id| id.0));
    canonical.identifier(module.leader.map(|id| id.0));
    canonical.identifier(module.pin.map(|id| id.0));
}

/// The digest of the input of a plan.
pub fn of_problem(problem: &PlanningProblem) -> Digest {
    let mut canonical = Canonical::new("formation problem 1");
    put_target(&mut canonical, problem.parameters(), Some(problem.target()));
    canonical.length(problem.modules().len());
    for module in problem.modules() {
        canonical.identifier(Some(module.id.0));
        put_placement(&mut canonical, module);
    }
    for Area { low, high } in problem.bodies() {
        for coordinate in [low.0, low.1, high.0, high.1] {
            canonical.signed(coordinate.0);
        }
    }
    for module in problem.making_room() {
        canonical.identifier(Some(module.id.0));
        put_placement(&mut canonical, module);
    }
    canonical.finish()
}

fn put_bodies(canonical: &mut Canonical, bodies: &[BodyReport]) {
    canonical.length(bodies.len());
    for body in bodies {
        canonical.identifier(Some(body.module.0));
        canonical.number(body.incarnation.0);
        canonical.number(body.epoch.map_or(0, |epoch| epoch.number));
        canonical.identifier(body.epoch.map(|epoch| epoch.convener.0));
        canonical.number(body.sequence);
        canonical.number(body.whereabouts.rank().into());
        let poses = body.whereabouts.poses();
        canonical.length(poses.len());
        for pose in poses {
            canonical.pose(pose);
        }
    }
}

impl PlanningProblem {
    /// Equal for equal problems, and different for others up to collisions of 64-bit hashes.
    #[must_use]
    pub fn digest(&self) -> Digest {
        of_problem(self)
    }
}

/// The digest of a target and the planner's parameters: equal for announcements that lead to the same plans, whatever
/// their revision and name.
pub fn of_target(announcement: &TargetAnnouncement) -> Digest {
    let mut canonical = Canonical::new("formation target 1");
    put_announcement(&mut canonical, announcement);
    canonical.finish()
}

fn put_motion(canonical: &mut Canonical, motion: &MotionPlan) {
    canonical.length(motion.units.len());
    for unit in &motion.units {
        canonical.length(unit.modules.len());
        for module in &unit.modules {
            canonical.identifier(Some(module.module.0));
            canonical.length(module.waypoints.len());
            for waypoint in &module.waypoints {
                canonical.pose(&waypoint.pose);
            }
        }
        canonical.length(unit.waits.len());
        for wait in &unit.waits {
            canonical.number(u64::from(wait.step));
            canonical.identifier(Some(wait.unit.0));
            canonical.number(u64::from(wait.steps_done));
        }
    }
}

fn put_voters(canonical: &mut Canonical, voters: &Voters) {
    put_modules(canonical, voters.named.iter());
    put_modules(canonical, voters.removed.iter());
    put_modules(canonical, voters.listed.iter());
}

fn put_modules<'a>(
    canonical: &mut Canonical,
    modules: impl ExactSizeIterator<Item = &'a ModuleId>,
) {
    canonical.length(modules.len());
    for module in modules {
        canonical.identifier(Some(module.0));
    }
}

/// Identifies the voters of a session; 0 if none are named.
pub fn of_voters(named: &[ModuleId]) -> u64 {
    if named.is_empty() {
        return 0;
    }
    let mut canonical = Canonical::new("formation voters 1");
    put_modules(&mut canonical, named.iter());
    canonical.finish().0.max(1)
}

/// The digest of a whole plan: the roster with its epoch, every decision in the order of the turns, and the paths.
/// Enforces T4, X7.
pub fn of_plan(
    roster: &Roster,
    decisions: &[(ModuleId, Decision)],
    motion: Option<&MotionPlan>,
) -> Digest {
    let mut canonical = Canonical::new("formation plan 5");
    canonical.number(roster.epoch.number);
    canonical.identifier(Some(roster.epoch.convener.0));
    put_announcement(&mut canonical, &roster.target);
    canonical.length(roster.members.len());
    for member in &roster.members {
        let module = &member.module;
        canonical.identifier(Some(module.id.0));
        canonical.number(member.incarnation.0);
        canonical.number(u64::from(member.knows));
        canonical.number(u64::from(member.is_idle));
        canonical.number(member.service as u64);
        put_placement(&mut canonical, module);
    }
    put_voters(&mut canonical, &roster.voters);
    put_bodies(&mut canonical, &roster.bodies);
    canonical.length(decisions.len());
    for (claimant, decision) in decisions {
        canonical.identifier(Some(claimant.0));
        canonical.length(decision.selections.len());
        for selection in &decision.selections {
            canonical.identifier(Some(selection.spot.0));
            canonical.identifier(Some(selection.module.0));
        }
        canonical.length(decision.evictions.len());
        for eviction in &decision.evictions {
            canonical.identifier(Some(eviction.evicted.0));
            canonical.identifier(Some(eviction.by.0));
            canonical.identifier(Some(eviction.from.0));
            canonical.identifier(eviction.to.map(|id| id.0));
        }
        canonical.length(decision.detached.len());
        for module in &decision.detached {
            canonical.identifier(Some(module.0));
        }
    }
    canonical.number(u64::from(motion.is_some()));
    if let Some(motion) = motion {
        put_motion(&mut canonical, motion);
    }
    let last = decisions.last().map(|(_, last)| &last.swaps);
    if let Some(swaps) = last.filter(|swaps| !swaps.is_empty()) {
        canonical.length(swaps.len());
        for swap in swaps {
            canonical.identifier(Some(swap.spot.0));
            canonical.identifier(Some(swap.module.0));
        }
    }
    canonical.finish()
}
