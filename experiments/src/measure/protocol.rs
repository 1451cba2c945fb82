//! What is said, and when, while the agents plan: the protocol as it runs in the simulator.
//!
//! The agents are those that run under DDS. Time is the simulator's: messages take 0.2 to 5 ms and computing takes none,
//! so that the curves show the protocol and not the machine. Time begins when the roster is published and ends when the
//! last module has applied the last claim.

use std::sync::Arc;
use std::time::Duration;

use formation::model::{Decision, Message, ModuleId, PlanningProblem, RosterMessage};
use formation::planner;
use formation::protocol::{AgentParameters, Event};
use formation_sim::{Cluster, ClusterParameters, Observation};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::spot_table::SpotTable;

/// Planning that takes longer than this in the simulator stands still.
const LIMIT: Duration = Duration::from_secs(300);

/// What was recorded of one planning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProtocolMeasurement {
    /// How many modules take part.
    pub modules: usize,
    /// How many spots can be filled.
    pub fillable_spots: usize,
    /// From the roster until the last module has applied the last claim, in microseconds of simulated time.
    pub planning_us: u64,
    /// One entry a claim, in the order of publication.
    pub claims: Vec<ClaimRecord>,
    /// How many heartbeats were published in that time.
    pub heartbeats: usize,
    /// How many states of modules were published in that time.
    pub states: usize,
    /// How many eviction notices were published.
    pub notices: usize,
    /// How many spots are selected in the end.
    pub filled_spots: usize,
}

/// One claim, when it was published, and what stands after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClaimRecord {
    /// Simulated time since the roster, in microseconds.
    pub at_us: u64,
    /// How many (spot, selector) pairs it says.
    pub pairs: usize,
    /// How many modules it evicts, which is told in a notice each.
    pub evictions: usize,
    /// How many spots are selected after it.
    pub selected: usize,
    /// How many spots are selected after it by the module that has them in the end.
    pub settled: usize,
}

impl ProtocolMeasurement {
    /// How many modules hear each message.
    #[must_use]
    pub fn receivers(&self) -> usize {
        self.modules.saturating_sub(1)
    }

    /// Claims and eviction notices published.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.claims.len() + self.notices
    }

    /// Claims and eviction notices, times those that hear them.
    #[must_use]
    pub fn deliveries(&self) -> usize {
        self.samples() * self.receivers()
    }

    /// (Spot, selector) pairs in claims, times those that hear them.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.claims.iter().map(|claim| claim.pairs).sum::<usize>() * self.receivers()
    }
}

/// Why nothing could be recorded.
#[derive(Debug, Error)]
pub enum ProtocolError {
    /// The agents did not come to an end.
    #[error("only {planned} of {modules} modules had planned after {} s of simulated time", LIMIT.as_secs())]
    StandsStill {
        /// How many had.
        planned: usize,
        /// How many there are.
        modules: usize,
    },
    /// More than one epoch was opened, though nothing failed.
    #[error("a second epoch was opened while planning")]
    SecondEpoch,
    /// The agents' plan is not the one that the offline planner makes.
    #[error("the agents' plan differs from the offline one")]
    DifferentPlan,
}

/// Lets the agents plan an instance in the simulator.
pub(crate) fn measure(
    problem: &Arc<PlanningProblem>,
    seed: u64,
) -> Result<ProtocolMeasurement, ProtocolError> {
    let parameters = ClusterParameters {
        agent: AgentParameters {
            plan_only: true,
            ..AgentParameters::default()
        },
        ..ClusterParameters::default()
    };
    let mut cluster = Cluster::new(problem, parameters, seed);
    cluster.announce_problem(problem, 1);
    let modules = problem.modules().len();
    let mut recorder = Recorder::default();
    while recorder.planned < modules {
        let goes_on = cluster.step(LIMIT);
        for (time, observation) in cluster.take_observations() {
            recorder.record(time, &observation)?;
        }
        if !goes_on && recorder.planned < modules {
            return Err(ProtocolError::StandsStill {
                planned: recorder.planned,
                modules,
            });
        }
    }
    let offline = planner::plan(Arc::clone(problem)).plan;
    let agrees = |module: ModuleId| {
        let agent = cluster.agent(module);
        agent.and_then(|agent| agent.plan()) == Some(&offline)
    };
    if recorder.table.spot_of != offline.assignments || !cluster.running().into_iter().all(agrees) {
        return Err(ProtocolError::DifferentPlan);
    }
    Ok(recorder.finish(problem))
}

#[derive(Default)]
struct Recorder {
    roster_at: Option<Duration>,
    ended_at: Duration,
    planned: usize,
    claims: Vec<(Duration, Decision)>,
    notices: usize,
    heartbeats: usize,
    states: usize,
    table: SpotTable,
}

impl Recorder {
    fn record(&mut self, time: Duration, observation: &Observation) -> Result<(), ProtocolError> {
        match observation {
            Observation::Published(_, message) => {
                let planning = usize::from(self.roster_at.is_some());
                match message {
                    Message::Roster(RosterMessage::Plan(_)) => {
                        if self.roster_at.replace(time).is_some() {
                            return Err(ProtocolError::SecondEpoch);
                        }
                    }
                    Message::Claim(claim) => {
                        self.table.apply(&claim.decision);
                        self.claims.push((time, claim.decision.clone()));
                    }
                    Message::Eviction(_) => self.notices += 1,
                    Message::Heartbeat(_) => self.heartbeats += planning,
                    Message::ModuleState(_) => self.states += planning,
                    Message::Roster(_) | Message::Target(_) => {}
                }
            }
            Observation::Noted(_, Event::Planned { .. }) => {
                self.planned += 1;
                self.ended_at = time;
            }
            Observation::Noted(..)
            | Observation::SetOff(..)
            | Observation::Announced(_)
            | Observation::Fault(_) => {}
        }
        Ok(())
    }

    fn finish(self, problem: &PlanningProblem) -> ProtocolMeasurement {
        let begin = self.roster_at.unwrap_or_default();
        let micros = |time: Duration| {
            u64::try_from(time.saturating_sub(begin).as_micros()).unwrap_or(u64::MAX)
        };
        let mut table = SpotTable::default();
        let claims = self
            .claims
            .iter()
            .map(|(time, decision)| {
                table.apply(decision);
                ClaimRecord {
                    at_us: micros(*time),
                    pairs: decision.selections.len(),
                    evictions: decision.evictions.len(),
                    selected: table.spot_of.len(),
                    settled: table.in_common_with(&self.table),
                }
            })
            .collect();
        let (modules, spots) = (problem.modules().len(), problem.target().spots().len());
        ProtocolMeasurement {
            modules,
            fillable_spots: modules.min(spots),
            planning_us: micros(self.ended_at),
            claims,
            heartbeats: self.heartbeats,
            states: self.states,
            notices: self.notices,
            filled_spots: self.table.spot_of.len(),
        }
    }
}
