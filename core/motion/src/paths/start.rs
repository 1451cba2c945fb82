//! From real start poses onto the lattice.
//!
//! Modules that are docked to each other at the start are one *group*. A group turns in place until its headings are
//! quarter turns, then shifts along x, then along y, to the cells under its modules. If the bodies do not overlap at
//! the start, and no other body reaches into the circle of a group that turns, then no two groups meet: rounding
//! keeps the order of two bodies in a row, and a group that moves to the right waits for the one on its right.
//!
//! Poses are measured, so bodies count as apart while their cells overlap by no more than the *slack*, and a group that is
//! turned by so little comes into line without a turn of its own. The slack is a third of what `body_width` leaves of a
//! cell: two bodies that are off by it and turned by it do not touch, nor do they while both come into line.
//!
//! A group whose modules stand off a common lattice regroups instead: each module goes to its own cell (`regroup`).

use super::group::{Alignment, Exactness, Group, Phase};
use super::lattice::{Lattice, point};
use super::rectangle::{HALF, Rectangle, overlap, square};
use super::regroup::RegroupingGround;
use super::resting::{AtRest, slack};
use super::result::{MotionRequest, StartFault};
use super::shape::Shape;
use formation_model::turning::Point;
use formation_model::{PlanningProblem, Pose};

/// Groups the modules that are not pinned, checks that they start apart, and plans their steps onto the lattice.
///
/// `spots_of` gives the poses of the spots of a group's modules if they are one unit of the plan.
/// Enforces X10.
pub(super) fn align(
    request: &MotionRequest,
    lattice: &Lattice,
    resting: &AtRest,
    spots_of: impl Fn(&[usize]) -> Option<Vec<Pose>>,
) -> Result<Vec<Group>, Vec<StartFault>> {
    let (problem, tolerance) = (request.problem, request.parameters.tolerance);
    let slack = slack(problem, tolerance.0);
    let exactness = Exactness {
        tolerance: tolerance.0,
        slack,
    };
    let (mut groups, mut faults) = groups_of(request, (lattice, resting), exactness, spots_of);
    groups.sort_by_key(|group| group.modules[0]);
    for group in &mut groups {
        if !group.ways.is_empty() {
            group.steps = vec![Alignment::at_once(Phase::Regroup)];
            if group.turn != 0 {
                group.steps.push(Alignment::at_once(Phase::Turn));
            }
            continue;
        }
        let moves = [
            (Phase::Turn, group.turn),
            (Phase::Column, group.shift.0),
            (Phase::Row, group.shift.1),
        ];
        let needed = moves.into_iter().filter(|&(_, by)| by.abs() > tolerance.0);
        group.steps = needed.map(|(phase, _)| Alignment::at_once(phase)).collect();
        if group.is_askew() && group.steps.is_empty() {
            group.steps = vec![Alignment::at_once(Phase::Column)];
        }
    }
    let pairs = near_pairs(&groups);
    faults.extend(
        pairs
            .iter()
            .filter_map(|&(one, other)| not_apart(problem, &groups[one], &groups[other], slack)),
    );
    if faults.is_empty() {
        faults = schedule(problem, &mut groups, &pairs, exactness);
    }
    if faults.is_empty() {
        Ok(groups)
    } else {
        Err(faults)
    }
}

/// The groups, and what keeps modules from being in one.
fn groups_of(
    request: &MotionRequest,
    (lattice, resting): (&Lattice, &AtRest),
    exactness: Exactness,
    spots_of: impl Fn(&[usize]) -> Option<Vec<Pose>>,
) -> (Vec<Group>, Vec<StartFault>) {
    let problem = request.problem;
    let mut groups = Vec::new();
    let mut faults = Vec::new();
    let mut is_grouped = vec![false; problem.modules().len()];
    let mut bodies: Vec<Vec<usize>> = Vec::new();
    for configuration in problem.configurations() {
        let members = configuration.modules.iter();
        let modules: Vec<usize> = members.filter_map(|&id| problem.position_of(id)).collect();
        for &module in &modules {
            is_grouped[module] = true;
        }
        if modules.iter().any(|&module| !resting.stands[module]) {
            bodies.push(modules);
        }
    }
    for (module, is_grouped) in is_grouped.into_iter().enumerate() {
        if let Some(group) = staying(problem, lattice, resting, module) {
            groups.push(group);
        } else if !is_grouped {
            bodies.push(vec![module]);
        }
    }
    let is_round = resting.bodies.form.is_round;
    let mut loose = Vec::new();
    for modules in bodies {
        let spots = spots_of(&modules);
        match Group::of(
            problem,
            modules.clone(),
            spots.as_deref(),
            lattice,
            exactness,
        ) {
            Some(mut group) => {
                if is_round && group.modules.len() == 1 {
                    group.radius = HALF;
                }
                groups.push(group);
            }
            None => loose.push((modules, None)),
        }
    }
    let cramped = cramped(problem, &groups, is_round, exactness.slack);
    let (cramped, rest): (Vec<_>, Vec<_>) = groups
        .into_iter()
        .zip(cramped)
        .partition(|&(_, is_cramped)| is_cramped);
    let cramped = cramped.into_iter().map(|(group, _)| group);
    loose.extend(cramped.map(|group| (group.modules.clone(), Some(group))));
    let groups: Vec<Group> = rest.into_iter().map(|(group, _)| group).collect();
    let narrow = without_room(request, &groups, exactness.slack);
    let (narrow, rest): (Vec<_>, Vec<_>) =
        (groups.into_iter().zip(narrow)).partition(|&(_, is_narrow)| is_narrow);
    let mut groups: Vec<Group> = rest.into_iter().map(|(group, _)| group).collect();
    let mut ground =
        RegroupingGround::new(request, (lattice, resting.bodies.form), exactness.slack);
    for group in &groups {
        ground.take(group);
    }
    for (modules, _) in &loose {
        ground.stand(modules);
    }
    for (group, _) in &narrow {
        ground.stand_in_cells(&group.modules);
    }
    for (group, _) in narrow {
        // Where it has room nowhere, what is too close to it is to be named.
        let group = ground.enter(&group).unwrap_or(group);
        ground.take(&group);
        groups.push(group);
    }
    for (modules, group) in loose {
        // A module that is docked to nothing is off no lattice: the body that is too close to it is to be named.
        let alone = group.filter(|group| group.modules.len() == 1);
        match ground.regroup(modules).or_else(|fault| alone.ok_or(fault)) {
            Ok(group) => {
                ground.take(&group);
                groups.push(group);
            }
            Err(fault) => faults.push(fault),
        }
    }
    (groups, faults)
}

/// A module that stays where it is: it is pinned, or stands on its spot off the lattice.
fn staying(
    problem: &PlanningProblem,
    lattice: &Lattice,
    resting: &AtRest,
    module: usize,
) -> Option<Group> {
    let member = &problem.modules()[module];
    if resting.stands[module] {
        let mut group = Group::standing(module, lattice.site(point(&member.pose)), lattice);
        group.at_rest = Some(resting.bodies.form.cell_at(&member.pose));
        return Some(group);
    }
    let spot = problem.target().position_of(member.pin?)?;
    let pose = &problem.target().spots()[spot].pose;
    let mut group = Group::standing(module, lattice.site(point(pose)), lattice);
    let is_off = resting.bodies.is_off[spot];
    group.at_rest = is_off.then(|| resting.bodies.cell_at(problem.target(), spot));
    Some(group)
}

/// Which bodies lack the room to come onto the lattice, as one next to a body that rests off it and a round one may, or into
/// line, as one whose members were halted at different moments may.
fn cramped(problem: &PlanningProblem, groups: &[Group], is_round: bool, slack: i64) -> Vec<bool> {
    let may_be = |one: &Group, other: &Group| {
        one.at_rest.is_none() && (is_round || one.is_askew() || other.at_rest.is_some())
    };
    let mut cramped = vec![false; groups.len()];
    for (low, high) in near_pairs(groups) {
        for (one, other) in [(low, high), (high, low)] {
            let (body, next) = (&groups[one], &groups[other]);
            cramped[one] = cramped[one]
                || may_be(body, next) && not_apart(problem, body, next, slack).is_some();
        }
    }
    cramped
}

/// Which groups have no room to turn where they stand: an obstacle or another group reaches into their circle.
fn without_room(request: &MotionRequest, groups: &[Group], slack: i64) -> Vec<bool> {
    let is_open = |body: &Shape| request.is_open(body);
    let turns = |group: &Group| group.turn != 0 && group.at_rest.is_none() && group.ways.is_empty();
    let is_closed = |group: &Group| turns(group) && !group.bodies().iter().all(is_open);
    let mut narrow: Vec<bool> = groups.iter().map(is_closed).collect();
    for (low, high) in near_pairs(groups) {
        let fault = not_apart(request.problem, &groups[low], &groups[high], slack);
        if matches!(fault, Some(StartFault::NotApart(..))) {
            for group in [low, high] {
                narrow[group] |= turns(&groups[group]);
            }
        }
    }
    narrow
}

/// The pairs of groups whose surroundings overlap, lower first.
fn near_pairs(groups: &[Group]) -> Vec<(usize, usize)> {
    let surroundings: Vec<Rectangle> = groups.iter().map(Group::surroundings).collect();
    let mut by_left: Vec<usize> = (0..groups.len()).collect();
    by_left.sort_unstable_by_key(|&group| (surroundings[group].0.0, group));
    let mut pairs = Vec::new();
    for (rank, &one) in by_left.iter().enumerate() {
        for &other in &by_left[rank + 1..] {
            if surroundings[other].0.0 > surroundings[one].1.0 {
                break;
            }
            if overlap(&surroundings[one], &surroundings[other], 0) {
                pairs.push((one.min(other), one.max(other)));
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

/// What is wrong with the distance of two groups, if anything.
fn not_apart(
    problem: &PlanningProblem,
    one: &Group,
    other: &Group,
    slack: i64,
) -> Option<StartFault> {
    let id = |group: &Group, member: usize| problem.modules()[group.modules[member]].id;
    for (group, standing) in [(one, other), (other, one)] {
        let Some(body) = &standing.at_rest else {
            continue;
        };
        let is_clear = group.at_rest.is_some()
            || !group
                .on_the_way()
                .iter()
                .any(|shape| shape.overlaps(body, slack));
        let (first, second) = (id(group, 0), id(standing, 0));
        let fault = StartFault::NotApart(first.min(second), first.max(second));
        return (!is_clear).then_some(fault);
    }
    let (bodies, neighbours) = (one.bodies(), other.bodies());
    // The circle in which a group turns comes after its members.
    let member_of = |group: &Group, body: usize| body.min(group.modules.len() - 1);
    let mut all = (0..bodies.len())
        .flat_map(|member| (0..neighbours.len()).map(move |its_member| (member, its_member)));
    let close = all.find(|&(body, next)| bodies[body].overlaps(&neighbours[next], slack));
    if let Some((body, next)) = close {
        let (first, second) = (
            id(one, member_of(one, body)),
            id(other, member_of(other, next)),
        );
        let (first, second) = (first.min(second), first.max(second));
        return Some(StartFault::NotApart(first, second));
    }
    let mut cells = (0..one.offsets.len())
        .flat_map(|member| (0..other.offsets.len()).map(move |its_member| (member, its_member)));
    let shared = cells.find(|&(member, next)| one.site_of(member) == other.site_of(next));
    shared.map(|(member, next)| StartFault::SharedCell(id(one, member), id(other, next)))
}

/// Sets begins and waits: a step waits for the earlier phases of groups in its way and, within a phase, for the group
/// in front.
fn schedule(
    problem: &PlanningProblem,
    groups: &mut [Group],
    pairs: &[(usize, usize)],
    Exactness { tolerance, slack }: Exactness,
) -> Vec<StartFault> {
    let mut waits: Vec<(usize, Phase, usize, Phase)> = Vec::new();
    for &(one, other) in pairs {
        let is_apart = not_apart(problem, &groups[one], &groups[other], tolerance).is_none();
        let slack = if is_apart { tolerance } else { slack };
        for (waiting, first) in [(one, other), (other, one)] {
            for phase in Phase::ALL {
                let swept = groups[waiting].swept(phase);
                let meets = |shapes: &[Shape]| {
                    let mut bodies = swept.iter();
                    bodies.any(|body| shapes.iter().any(|rest| body.overlaps(rest, slack)))
                };
                let mut earlier = [Phase::Column, Phase::Turn, Phase::Regroup]
                    .into_iter()
                    .filter(|&it| it < phase);
                let last = earlier.find(|&it| meets(&groups[first].swept(it)));
                if let Some(last) = last {
                    waits.push((waiting, phase, first, last));
                }
                if phase != Phase::Turn
                    && must_follow(&groups[waiting], &groups[first], phase, slack)
                {
                    waits.push((waiting, phase, first, phase));
                }
            }
        }
    }
    let index = |group: &Group, phase: Phase| group.steps.iter().position(|it| it.phase == phase);
    for _ in 0..=3 * groups.len() {
        let mut changed = None;
        for group in groups.iter_mut() {
            for step in 1..group.steps.len() {
                group.steps[step].begin =
                    group.steps[step].begin.max(group.steps[step - 1].begin + 1);
            }
        }
        for &(waiting, phase, first, last) in &waits {
            let (Some(step), Some(awaited)) =
                (index(&groups[waiting], phase), index(&groups[first], last))
            else {
                continue;
            };
            let earliest = groups[first].steps[awaited].begin + 1;
            if groups[waiting].steps[step].begin < earliest {
                groups[waiting].steps[step].begin = earliest;
                changed = Some((waiting, first));
            }
        }
        if changed.is_none() {
            for &(waiting, phase, first, last) in &waits {
                let found = (index(&groups[waiting], phase), index(&groups[first], last));
                if let (Some(step), Some(awaited)) = found {
                    let count = u32::try_from(awaited + 1).unwrap_or(u32::MAX);
                    groups[waiting].steps[step].waits.push((first, count));
                }
            }
            return Vec::new();
        }
    }
    // Only groups that reach around each other can wait for each other in a circle.
    let stuck = pairs.iter().map(|&(one, other)| {
        let id = |group: usize| problem.modules()[groups[group].modules[0]].id;
        StartFault::SharedCell(id(one), id(other))
    });
    stuck.collect()
}

/// Whether a group that shifts in a phase would reach by more than `slack` into the place that another leaves in the same
/// phase. Two that overlap by less, next to each other, need not follow each other.
fn must_follow(group: &Group, ahead: &Group, phase: Phase, slack: i64) -> bool {
    let along = |point: Point| {
        if phase == Phase::Row {
            point.1
        } else {
            point.0
        }
    };
    let (shift, shift_ahead) = (along(group.shift), along(ahead.shift));
    if shift.signum() * shift_ahead.signum() != 1 {
        return false;
    }
    let members = 0..ahead.offsets.len();
    let rest = members.map(|member| square(ahead.position_before(member, phase)));
    let rest: Vec<Rectangle> = rest.collect();
    (0..group.offsets.len()).any(|member| {
        let body = square(group.position_after(member, phase));
        rest.iter().any(|other| overlap(&body, other, slack))
    })
}
