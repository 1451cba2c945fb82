//! The motion plan in the terms of modules, spots and poses.

use super::group::{Group, Phase};
use super::lattice::{Lattice, Time};
use super::lattice_request::{Crew, LatticeRequest};
use super::route::{Errand, Routes, STEP};
use super::schedule::Schedule;
use super::units::{Node, Unit, node_count, split};
use super::variants::Solution;
use super::waits::{Graph, UnitWait};
use formation_model::turning::{Point, angle_of, quarters, shortest};
use formation_model::{
    MICRO_PER_UNIT, MicroUnits, ModuleId, ModuleMotion, MotionPlan, Pose, Step, StepKind,
    UnitMotion, Wait, Waypoint,
};

/// A solution and what it was made from.
pub(super) struct Draft<'a> {
    pub on_lattice: &'a LatticeRequest<'a>,
    pub crew: &'a Crew,
    pub solution: &'a Solution<'a>,
    /// Search nodes of failed tries.
    pub spent: u64,
}

impl Draft<'_> {
    /// The motion plan, as yet without the blocks that were taken apart.
    pub fn plan(&self) -> MotionPlan {
        let schedule = &self.solution.schedule;
        let group_of: Vec<usize> = schedule
            .units
            .iter()
            .map(|unit| self.on_lattice.group_of[unit.modules[0]])
            .collect();
        let graph = Graph {
            schedule,
            groups: &self.on_lattice.groups,
            group_of: &group_of,
            aligners: &self.on_lattice.aligners,
        };
        let waits = graph.waits();
        let shortest = self.shortest();
        let surplus = (0..schedule.units.len()).filter(|&unit| schedule.units[unit].goal.is_none());
        let sequence = self.crew.docking.iter().copied().chain(surplus);
        let docked = self.docked();
        let units = sequence
            .map(|unit| UnitMotion {
                docked_at: docked[unit],
                ..self.unit_motion(unit, &waits[unit], shortest[unit], &group_of)
            })
            .collect();
        MotionPlan {
            units,
            taken_apart: Vec::new(),
            variant: self.solution.variant,
            makespan: schedule.cost().0,
            bound: shortest.iter().copied().max().unwrap_or_default(),
            expansions: self.spent + self.solution.expansions,
        }
    }

    /// When each unit docks: when it and the unit to which it docks have arrived, and that one has docked.
    fn docked(&self) -> Vec<Option<Time>> {
        let schedule = &self.solution.schedule;
        let mut docked = vec![None; schedule.units.len()];
        for &unit in &self.crew.docking {
            let arrived = (!schedule.units[unit].pinned).then(|| schedule.since(unit));
            let parent = self.crew.parents[unit].and_then(|parent| docked[parent]);
            docked[unit] = arrived.max(parent).or(Some(0));
        }
        docked
    }

    /// For each unit the steps to its spots if there were only obstacles and pinned modules.
    fn shortest(&self) -> Vec<Time> {
        let schedule = &self.solution.schedule;
        let arena = &self.on_lattice.arena;
        let mut solid = arena.closed.clone();
        for unit in schedule.units.iter().filter(|unit| unit.stays) {
            for cell in unit.cells(arena, unit.start) {
                solid[cell] = true;
            }
        }
        let mut routes = Routes::new(node_count(schedule.units, arena));
        let mut steps = |unit: &Unit| {
            let goal = unit.goal.filter(|_| !unit.stays)?;
            let errand = Errand {
                arena,
                unit,
                from: unit.start,
                folds: true,
            };
            let cost = |cell: usize| (!solid[cell]).then_some(0);
            let rest = |node: Node| unit.distance(arena, node, goal) * STEP;
            let route = routes.find(&errand, cost, rest, |node| node == goal)?;
            Time::try_from(route.len() - 1).ok()
        };
        schedule
            .units
            .iter()
            .map(|unit| {
                let group = &self.on_lattice.groups[self.on_lattice.group_of[unit.modules[0]]];
                let aligned = Time::try_from(group.steps.len()).unwrap_or_default();
                steps(unit).map_or(0, |steps| steps + aligned)
            })
            .collect()
    }

    fn lead(&self, unit: usize) -> ModuleId {
        let module = self.solution.schedule.units[unit].modules[0];
        self.on_lattice.request.problem.modules()[module].id
    }

    fn unit_motion(
        &self,
        unit: usize,
        waits: &[UnitWait],
        shortest: Time,
        group_of: &[usize],
    ) -> UnitMotion {
        let schedule = &self.solution.schedule;
        let group = &self.on_lattice.groups[group_of[unit]];
        let body = &schedule.units[unit];
        let others =
            (0..group_of.len()).filter(|&other| other != unit && group_of[other] == group_of[unit]);
        let modules = (0..body.modules.len()).map(|member| self.module_motion(unit, member, group));
        UnitMotion {
            lead: self.lead(unit),
            modules: modules.collect(),
            steps: steps(schedule, unit, group, &self.on_lattice.lattice),
            waits: waits
                .iter()
                .map(|&(step, other, steps_done)| Wait {
                    step,
                    unit: self.lead(other),
                    steps_done,
                })
                .collect(),
            joint_steps: u32::try_from(group.steps.len()).unwrap_or(u32::MAX),
            joint_with: others.map(|other| self.lead(other)).collect(),
            parent: self.crew.parents[unit].map(|parent| self.lead(parent)),
            docked_at: None,
            shortest,
        }
    }

    fn module_motion(&self, unit: usize, member: usize, group: &Group) -> ModuleMotion {
        let on_lattice = self.on_lattice;
        let schedule = &self.solution.schedule;
        let body = &schedule.units[unit];
        let module = body.modules[member];
        let start = on_lattice.request.problem.modules()[module].pose;
        let spot = on_lattice.spot_of[module]
            .map(|spot| on_lattice.request.problem.target().spots()[spot]);
        let heading = group.heading(start.theta.0);
        let goal = spot.map_or(heading, |spot| {
            shortest(angle_of(quarters(spot.pose.theta.0)))
        });
        let in_group = group
            .modules
            .iter()
            .position(|&other| other == module)
            .unwrap_or_default();
        let mut waypoints = vec![Waypoint {
            pose: start,
            time: 0,
        }];
        waypoints.extend(group.steps.iter().map(|step| Waypoint {
            pose: pose(
                group.position_after(in_group, step.phase),
                group.heading_after(start.theta.0, step.phase),
            ),
            time: step.begin + 1,
        }));
        waypoints.extend(schedule.paths[unit].iter().map(|entry| Waypoint {
            pose: pose_at(
                &on_lattice.lattice,
                schedule,
                body,
                entry.node,
                member,
                (heading, goal),
            ),
            time: entry.begin + 1,
        }));
        if let (Some(spot), Some(last)) = (spot, waypoints[1..].last_mut()) {
            // Spots may be off their cells' middles, and off quarter turns, by the tolerance.
            last.pose = spot.pose;
        }
        ModuleMotion {
            module: on_lattice.request.problem.modules()[module].id,
            spot: spot.map(|spot| spot.id),
            waypoints,
        }
    }
}

fn pose((x, y): Point, theta: i64) -> Pose {
    Pose {
        x: MicroUnits(x),
        y: MicroUnits(y),
        theta: MicroUnits(theta),
    }
}

/// The pose of a member at a node; at a disc half-way between its two layouts.
fn pose_at(
    lattice: &Lattice,
    schedule: &Schedule,
    body: &Unit,
    node: Node,
    member: usize,
    (heading, goal): (i64, i64),
) -> Pose {
    if let Some(step) = body.exit_step(schedule.arena, node) {
        return step.poses[member];
    }
    let (layout, cell) = split(schedule.arena, node);
    let (x, y) = schedule.arena.site(cell);
    let at = |layout: usize| {
        let (right, up) = body.layouts[layout].sites[member];
        lattice.point((x + right, y + up))
    };
    if body.is_disc(schedule.arena, node) {
        let (from, to) = (at(0), at(body.last_on_lattice()));
        let middle = (from.0.midpoint(to.0), from.1.midpoint(to.1));
        return pose(middle, shortest(heading + shortest(goal - heading) / 2));
    }
    pose(at(layout), if layout == 0 { heading } else { goal })
}

/// The steps of a unit.
fn steps(schedule: &Schedule, unit: usize, group: &Group, lattice: &Lattice) -> Vec<Step> {
    let body = &schedule.units[unit];
    let mut steps: Vec<Step> = group
        .steps
        .iter()
        .map(|step| Step {
            kind: match step.phase {
                Phase::Turn => StepKind::Turn {
                    centre: pose(group.centre, group.turn),
                    radius: MicroUnits(group.radius),
                },
                Phase::Regroup if !group.enters() => StepKind::Regroup,
                Phase::Regroup | Phase::Column | Phase::Row => StepKind::Shift,
            },
            begin: step.begin,
        })
        .collect();
    let mut before = body.start;
    for entry in &schedule.paths[unit] {
        let folds = [before, entry.node]
            .into_iter()
            .find(|&node| body.is_disc(schedule.arena, node));
        let exit = body.exit_step(schedule.arena, entry.node);
        let kind = match folds {
            _ if exit.is_some() => exit.map_or(StepKind::Shift, |step| step.kind),
            Some(node) => {
                let (_, cell) = split(schedule.arena, node);
                let quarters = i128::from(body.disc) * i128::from(MICRO_PER_UNIT / 2).pow(2);
                StepKind::Fold {
                    centre: pose(lattice.point(schedule.arena.site(cell)), 0),
                    radius: MicroUnits(i64::try_from(quarters.isqrt()).unwrap_or(i64::MAX)),
                }
            }
            None => StepKind::Move,
        };
        steps.push(Step {
            kind,
            begin: entry.begin,
        });
        before = entry.node;
    }
    steps
}
