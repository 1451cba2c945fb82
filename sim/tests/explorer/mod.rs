//! A search through every schedule of a small cluster, up to a bound.
//!
//! A schedule is the order in which messages are delivered and timers run out. The plain one delivers messages at once, in
//! the order in which they were sent, and lets a timer run out when none is left. A *deviation* delivers a message before
//! one that was sent earlier on another channel, loses a heartbeat, or lets the next timer run out although messages are
//! on their way. Every schedule up to a number of deviations is searched, each with at most one fault at any step: a
//! crash, a crash and a restart, or one module cut off for a while (delay-bounded scheduling: Emmi, Qadeer and
//! Rakamaric, 2011). A state that was met before is not searched again.

mod evidence;
mod steps;
mod world;

use std::collections::HashSet;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Incarnation, PlanningProblem, TargetAnnouncement};
use formation_protocol::AgentParameters;
use formation_sim::AgentFactory;

use world::{Disturbance, Published, World};

const MODULES: usize = 3;

/// The bound of a search.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// The greatest number of deviations from the plain schedule.
    pub deviations: u8,
    /// Whether one fault may occur.
    pub fault: bool,
    /// The time from the start within which deviations and faults occur.
    pub until: Duration,
}

/// The result of a search.
#[derive(Debug, Default)]
pub struct Searched {
    /// The number of different states.
    pub states: usize,
    /// The number of steps from them.
    pub steps: usize,
    /// The number of states that were ends.
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
/// Agents and their environment.
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
            voters: Vec::new(),
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
                    searched.violation = Some((violation, steps_of(next.trail.as_ref())));
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
            disturbance: Disturbance {
                cut: None,
                agenda: None,
                deviations: bound.deviations,
                fault: bound.fault,
                last: Duration::ZERO,
            },
            published: Published::default(),
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

fn steps_of(trail: Option<&Rc<Trail>>) -> String {
    let mut lines = Vec::new();
    let mut next = trail;
    while let Some(trail) = next {
        lines.push(trail.line.as_str());
        next = trail.before.as_ref();
    }
    lines.reverse();
    lines.join("\n")
}
