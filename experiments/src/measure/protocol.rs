//! The messages of a planning and their times: the protocol as it runs in the simulator.
//!
//! The agents are those that run under DDS. Time is the simulator's: messages take 0.2 to 5 ms and computing takes none,
//! so that the curves show the protocol and not the machine. Time begins when the roster is published and ends when the
//! last module has applied the last claim.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Decision, Message, ModuleId, Plan, PlanningProblem, RosterMessage};
use formation_planner as planner;
use formation_protocol::{AgentParameters, Event};
use formation_sim::{Cluster, ClusterParameters, Observation};

use super::spot_table::SpotTable;
use super::talk::{Moment, Talk, correlation, course};
use crate::error::CellError;

/// Planning that takes longer than this in the simulator has failed.
const LIMIT: Duration = Duration::from_secs(300);

/// Plans an instance in the simulator.
pub(crate) fn measure(problem: &Arc<PlanningProblem>, seed: u64) -> Result<Talk, CellError> {
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
            recorder.record(time, &observation);
        }
        if !goes_on && recorder.planned < modules {
            return Err(CellError::Planning(format!(
                "only {} of {modules} modules had planned after {} s of simulated time",
                recorder.planned,
                LIMIT.as_secs()
            )));
        }
    }
    // The acting order is not compared: agents give up an order that walls a spot in, as their modules move along paths.
    let chosen = |plan: &Plan| {
        (
            plan.assignments.clone(),
            plan.blocks.clone(),
            plan.kept_links.clone(),
        )
    };
    let offline = planner::plan(Arc::clone(problem)).plan;
    let agrees = |module: ModuleId| {
        let plan = cluster.agent(module).and_then(|agent| agent.plan());
        plan.map(chosen) == Some(chosen(&offline))
    };
    let reason = if recorder.rosters.len() > 1 {
        "a second epoch was opened while planning"
    } else if recorder.table().spot_of != offline.assignments
        || !cluster.running().into_iter().all(agrees)
    {
        "the agents' plan differs from the offline one"
    } else {
        return Ok(recorder.finish(problem));
    };
    Err(CellError::Planning(reason.to_owned()))
}

#[derive(Default)]
struct Recorder {
    /// The times of all rosters; an epoch publishes one.
    rosters: Vec<Duration>,
    ended_at: Duration,
    planned: usize,
    /// The claim of each turn, and when it was published: before the claims of earlier turns or after them.
    claims: BTreeMap<u32, (Duration, Decision)>,
    notices: usize,
}

impl Recorder {
    fn record(&mut self, time: Duration, observation: &Observation) {
        match observation {
            Observation::Published(_, Message::Roster(RosterMessage::Plan(_))) => {
                self.rosters.push(time);
            }
            Observation::Published(_, Message::Claim(claim)) => {
                self.claims
                    .insert(claim.turn, (time, claim.decision.clone()));
            }
            Observation::Published(_, Message::Eviction(_)) => self.notices += 1,
            Observation::Noted(_, Event::Planned { .. }) => {
                self.planned += 1;
                self.ended_at = time;
            }
            _ => {}
        }
    }

    /// The spots after all turns.
    fn table(&self) -> SpotTable {
        let mut table = SpotTable::default();
        for (_, decision) in self.claims.values() {
            table.apply(decision);
        }
        table
    }

    fn finish(self, problem: &PlanningProblem) -> Talk {
        let begin = self.rosters.first().copied().unwrap_or_default();
        let micros = |time: Duration| {
            u64::try_from(time.saturating_sub(begin).as_micros()).unwrap_or(u64::MAX)
        };
        let last = self.table();
        let mut table = SpotTable::default();
        let mut moment = Moment::default();
        let moments = self.claims.values().map(|(time, decision)| {
            table.apply(decision);
            moment = Moment {
                // A claim counts once those of all earlier turns are there.
                at: moment.at.max(micros(*time)),
                pairs: moment.pairs + decision.selections.len(),
                selected: table.spot_of.len(),
                settled: table.in_common_with(&last),
            };
            moment
        });
        let moments: Vec<Moment> = moments.collect();
        let duration = micros(self.ended_at);
        let (modules, spots) = (problem.modules().len(), problem.target().spots().len());
        Talk {
            modules,
            fillable_spots: modules.min(spots),
            duration,
            samples: self.claims.len() + self.notices,
            steps: moments.len(),
            correlation: correlation(&moments),
            course: course(&moments, duration),
        }
    }
}
