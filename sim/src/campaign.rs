//! Runs of many seeds: each draws a scenario, a network and faults, and is judged by the invariants.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation::agent::AgentParameters;
use formation::generate::{GenerateError, GeneratorParameters, Grouping, Random};
use formation::id::ModuleId;
use formation::message::ModulePhase;
use formation::problem::PlanningProblem;
use formation::scenario::{Scenario, ScenarioError};

use crate::cluster::{Cluster, ClusterParameters};
use crate::faults::{Fault, FaultKind, Strike, draw};
use crate::invariants::{Violation, ViolationKind, Watch};
use crate::network::NetworkParameters;

/// What every run of a campaign has in common.
#[derive(Clone, Debug)]
pub struct CampaignParameters {
    /// Which faults strike.
    pub faults: FaultKind,
    /// The fewest modules of a drawn scenario.
    pub modules_min: usize,
    /// The most modules of a drawn scenario.
    pub modules_max: usize,
    /// The scenario to run instead of drawn ones.
    pub problem: Option<Arc<PlanningProblem>>,
    /// Faults strike within this time of the start.
    pub fault_span: Duration,
    /// How long after the last fault everything must have come to an end.
    pub patience: Duration,
    /// Whether to keep the readable account of each run.
    pub transcripts: bool,
}

impl Default for CampaignParameters {
    fn default() -> Self {
        Self {
            faults: FaultKind::Mixed,
            modules_min: 5,
            modules_max: 40,
            problem: None,
            fault_span: Duration::from_secs(40),
            patience: Duration::from_secs(900),
            transcripts: false,
        }
    }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All that run hold one plan and have carried it out.
    Formed,
    /// Too few are left to decide anything, and they say so.
    WaitingForQuorum,
    /// Neither, within the patience.
    Neither,
}

/// The outcome of one seed.
#[derive(Clone, Debug)]
pub struct RunReport {
    /// The seed.
    pub seed: u64,
    /// How many modules started.
    pub modules: usize,
    /// How many spots the target has.
    pub spots: usize,
    /// How many modules were running at the end.
    pub running: usize,
    /// How it ended.
    pub ending: Ending,
    /// How long after the last fault it ended; from the start when none struck.
    pub recovery: Duration,
    /// How many messages were published, heartbeats included.
    pub messages: u64,
    /// How many epochs were opened.
    pub epochs: u64,
    /// Every breach.
    pub violations: Vec<Violation>,
    /// The readable account, if it was kept.
    pub transcript: String,
}

/// Why a run could not begin.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The number of modules makes no scenario.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// The generated scenario is not valid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
}

/// Agents that recover quickly, so that runs are short; the ratios are those of the defaults.
fn agent_parameters() -> AgentParameters {
    AgentParameters {
        gather_limit: Duration::from_secs(15),
        motion_limit: Duration::from_secs(60),
        ..AgentParameters::default()
    }
}

fn draw_problem(
    parameters: &CampaignParameters,
    random: &mut Random,
) -> Result<PlanningProblem, CampaignError> {
    let span = parameters
        .modules_max
        .saturating_sub(parameters.modules_min)
        + 1;
    let modules = parameters.modules_min + random.index(span);
    // Spares in a third of the runs, too few modules in a sixth.
    let spots = match random.below(6) {
        0 | 1 => (modules - random.index(modules / 3 + 1)).max(1),
        2 => modules + random.index(modules / 3 + 1),
        _ => modules,
    };
    let generator =
        GeneratorParameters::new(modules, spots, random.below(u64::MAX)).grouped(Grouping::Mixed);
    let raw = formation::generate::generate(&generator)?;
    Ok(Scenario::try_from(raw)?.problem().clone())
}

/// Runs one seed.
///
/// # Errors
/// Says why no scenario could be made of the parameters.
pub fn run_seed(parameters: &CampaignParameters, seed: u64) -> Result<RunReport, CampaignError> {
    let mut random = Random::from_seed(seed);
    let drawn = draw_problem(parameters, &mut random);
    let problem = match &parameters.problem {
        Some(problem) => PlanningProblem::clone(problem),
        None => drawn?,
    };
    let modules: Vec<ModuleId> = problem.modules().iter().map(|module| module.id).collect();
    let faults = draw(
        parameters.faults,
        &modules,
        parameters.fault_span,
        &mut random,
    );
    let network = match parameters.faults {
        FaultKind::Mixed => NetworkParameters::rough(),
        _ => NetworkParameters::default(),
    };
    let cluster_parameters = ClusterParameters {
        agent: agent_parameters(),
        network,
        ..ClusterParameters::default()
    };
    let margin = network.latency_max + network.delay_max + Duration::from_millis(20);
    let mut watch = Watch::new(cluster_parameters.agent.lease, margin);
    let mut cluster = Cluster::new(&problem, cluster_parameters, random.below(u64::MAX));
    if parameters.transcripts {
        cluster.keep_transcript();
    }
    cluster.announce_problem(&problem, 1);
    let mut last_fault = Duration::ZERO;
    for fault in faults {
        run_to(&mut cluster, &mut watch, fault.at);
        strike(&mut cluster, &fault);
        last_fault = fault.at;
    }
    let limit = last_fault + parameters.patience;
    let mut ending = Ending::Neither;
    while ending == Ending::Neither && cluster.now() < limit {
        let next = (cluster.now() + Duration::from_millis(250)).min(limit);
        run_to(&mut cluster, &mut watch, next);
        // A pause may outlast the last fault, and a quorum may be found missing only for the moment.
        if cluster.now() > last_fault + Duration::from_secs(15)
            || parameters.faults == FaultKind::None
        {
            ending = ending_of(&cluster, problem.target().spots().len());
        }
    }
    let spots = problem.target().spots().len();
    judge_end(&cluster, &mut watch, ending, spots);
    Ok(RunReport {
        seed,
        modules: modules.len(),
        spots,
        running: cluster.running().len(),
        ending,
        recovery: cluster.now().saturating_sub(last_fault),
        messages: cluster.samples(),
        epochs: watch.epochs(),
        violations: watch.violations,
        transcript: cluster.transcript().to_owned(),
    })
}

fn run_to(cluster: &mut Cluster, watch: &mut Watch, time: Duration) {
    while cluster.step(time) {
        watch.look(cluster);
    }
}

fn strike(cluster: &mut Cluster, fault: &Fault) {
    match &fault.strike {
        Strike::Crash(module) => cluster.crash(*module),
        Strike::Restart(module) => cluster.restart(*module),
        Strike::Pause(module, duration) => cluster.pause(*module, *duration),
        Strike::Cut(aside) => cluster.cut(aside),
        Strike::Heal => cluster.heal(),
    }
}

fn ending_of(cluster: &Cluster, spots: usize) -> Ending {
    // Formed with a hole, newcomers may still be on their way into the next epoch.
    if cluster.has_formed() && filled_spots(cluster) == cluster.running().len().min(spots) {
        return Ending::Formed;
    }
    let waiting = cluster.running().iter().all(|&module| {
        cluster
            .standing(module)
            .is_some_and(|standing| standing.phase == ModulePhase::WaitingForQuorum)
    });
    if waiting {
        Ending::WaitingForQuorum
    } else {
        Ending::Neither
    }
}

fn filled_spots(cluster: &Cluster) -> usize {
    let filled: BTreeSet<_> = cluster
        .running()
        .iter()
        .filter_map(|&module| cluster.standing(module))
        .filter(|standing| standing.phase == ModulePhase::Settled)
        .filter_map(|standing| standing.spot)
        .collect();
    filled.len()
}

fn judge_end(cluster: &Cluster, watch: &mut Watch, ending: Ending, spots: usize) {
    if ending != Ending::Neither {
        return;
    }
    let running = cluster.running();
    if cluster.has_formed() {
        let (filled, wanted) = (filled_spots(cluster), running.len().min(spots));
        let detail = format!("{filled} of {wanted} spots are filled");
        watch.violate(cluster.now(), ViolationKind::Hole, detail);
        return;
    }
    let standings: Vec<String> = running
        .iter()
        .filter_map(|&module| {
            let standing = cluster.standing(module)?;
            let epoch = standing.epoch.map_or(0, |epoch| epoch.number);
            Some(format!("{} {:?} in {epoch}", module.0, standing.phase))
        })
        .collect();
    watch.violate(cluster.now(), ViolationKind::NoEnd, standings.join(", "));
}
