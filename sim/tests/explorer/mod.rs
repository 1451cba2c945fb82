//! A search through every schedule of a small cluster, up to a bound.
//!
//! A schedule is the order in which messages are delivered and timers run out. The plain one delivers messages at once, in
//! the order in which they were sent, and lets a timer run out when none is left. A *deviation* delivers a message before
//! one that was sent earlier on another channel, loses a heartbeat, or lets the next timer run out although messages are
//! on their way. Every schedule with at most so many deviations is searched, each with at most one fault at any step: a
//! crash, a crash and a restart, or one module cut off for a while (delay-bounded scheduling: Emmi, Qadeer and
//! Rakamaric, 2011). States that were met before are not searched again.

mod evidence;
mod steps;
mod world;

use std::collections::{BTreeMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{Incarnation, PlanningProblem, TargetAnnouncement};
use formation::protocol::AgentParameters;
use formation_sim::AgentFactory;

use world::World;

const MODULES: usize = 3;

/// How far to search.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// How often a schedule may deviate from the plain one.
    pub deviations: u8,
    /// Whether one fault may strike.
    pub fault: bool,
    /// Deviations and faults come within this time of the start.
    pub until: Duration,
}

/// What a search came to.
#[derive(Debug, Default)]
pub struct Searched {
    /// How many different states were met.
    pub states: usize,
    /// How many steps were taken from them.
    pub steps: usize,
    /// How many of the states were ends.
    pub ends: usize,
    /// The first violation, and the steps that led to it.
    pub violation: Option<(String, String)>,
}

/// One choice.
#[derive(Clone, Copy, Debug)]
enum Step {
    Deliver(usize),
    Lose(usize),
    RunTimer,
    Crash(usize),
    CrashAndRestart(usize),
    CutOff(usize),
}

struct Trail {
    before: Option<Rc<Trail>>,
    line: String,
}
/// Agents and their surroundings.
pub struct Explorer {
    problem: PlanningProblem,
    parameters: AgentParameters,
    agents: AgentFactory,
    target: Arc<TargetAnnouncement>,
}
impl Explorer {
    /// Three modules, numbered from 1, and time limits that keep schedules short.
    pub fn new(problem: PlanningProblem, agents: AgentFactory) -> Self {
        let target = Arc::new(TargetAnnouncement {
            revision: 1,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: Some(3),
        });
        let seconds = Duration::from_secs;
        let parameters = AgentParameters {
            heartbeat: seconds(1),
            suspicion: seconds(4),
            lease: Duration::from_millis(2_200),
            convene: seconds(1),
            gather: seconds(1),
            gather_limit: seconds(6),
            stuck: seconds(5),
            motion_limit: seconds(12),
            ..AgentParameters::default()
        };
        Self {
            problem,
            parameters: parameters.validated().unwrap(),
            agents,
            target,
        }
    }

    /// Searches depth first, and stops at the first violation.
    pub fn search(&self, bound: Bound) -> Searched {
        let mut searched = Searched::default();
        let mut met = HashSet::new();
        let mut stack = vec![self.start(bound)];
        while let Some(world) = stack.pop() {
            if !met.insert(world.hash()) {
                continue;
            }
            searched.states += 1;
            if world.has_ended(bound) {
                searched.ends += 1;
                continue;
            }
            for step in world.choices(bound) {
                searched.steps += 1;
                let mut next = world.clone();
                self.take(&mut next, step);
                if let Some(violation) = next.violation {
                    searched.violation = Some((violation, told(next.trail.as_ref())));
                    return searched;
                }
                stack.push(next);
            }
        }
        searched
    }

    fn start(&self, bound: Bound) -> World {
        let mut world = World {
            now: Duration::ZERO,
            actors: [None, None, None],
            flights: Vec::new(),
            held: Vec::new(),
            cut: None,
            agenda: None,
            deviations: bound.deviations,
            fault: bound.fault,
            disturbed: Duration::ZERO,
            latched: BTreeMap::new(),
            heartbeats: BTreeMap::new(),
            states: BTreeMap::new(),
            ended_since: None,
            evidence: Rc::default(),
            violation: None,
            trail: None,
        };
        for index in 0..MODULES {
            // Heartbeats at one instant would make every order of them a deviation.
            world.now = Duration::from_millis(100 * index as u64);
            self.launch(&mut world, index, Incarnation(1), None);
        }
        world
    }
}

fn told(trail: Option<&Rc<Trail>>) -> String {
    let mut lines = Vec::new();
    let mut next = trail;
    while let Some(trail) = next {
        lines.push(trail.line.as_str());
        next = trail.before.as_ref();
    }
    lines.reverse();
    lines.join("\n")
}
