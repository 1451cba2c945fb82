//! Runs of many seeds: each draws a scenario, a network and faults, and is judged by the invariants.

use std::sync::Arc;
use std::time::Duration;

use formation::generate::{GenerateError, GeneratorParameters, Grouping, Random};
use formation::model::{
    ModuleId, PlanningProblem, Scenario, ScenarioError, Target, TargetAnnouncement,
};
use formation::protocol::AgentParameters;

use crate::cluster::{Cluster, ClusterParameters};
use crate::faults::{Fault, FaultKind, Strike, draw};
use crate::invariants::{Violation, Watch};
use crate::network::NetworkParameters;
use crate::process::AgentFactory;
use crate::transcript::Transcript;

/// Two clocks that drift apart by twice this are just within what agents allow for.
const HOSTILE_DRIFT_PPM: u32 = 480;

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
    /// Whether to keep the transcript of each run.
    pub transcripts: bool,
    /// How agents are made.
    pub agents: AgentFactory,
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
            agents: AgentFactory::default(),
        }
    }
}

impl CampaignParameters {
    /// For how long an end must last to be believed.
    fn calm(&self, faults: &[Fault]) -> Duration {
        if faults.is_empty() {
            Duration::ZERO
        } else {
            2 * agent_parameters().suspicion
        }
    }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All that run hold one plan and have carried it out; those that are cut off from a majority say so.
    Formed,
    /// Too few are left within reach of each other to decide anything, and they say so.
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
    /// How long after the last fault had passed it reached the state in which it stayed; from the start when none
    /// struck.
    pub recovery: Duration,
    /// How many messages were published, heartbeats included.
    pub messages: u64,
    /// How many epochs were opened.
    pub epochs: u64,
    /// Every breach.
    pub violations: Vec<Violation>,
    /// The transcript, if it was kept.
    pub transcript: Transcript,
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
    let faults: Vec<Fault> = draw(
        parameters.faults,
        &modules,
        parameters.fault_span,
        &mut random,
    );
    let network = match parameters.faults {
        FaultKind::Mixed | FaultKind::Hostile => NetworkParameters::rough(),
        _ => NetworkParameters::default(),
    };
    let cluster_parameters = ClusterParameters {
        agent: agent_parameters(),
        network,
        drift_ppm_max: match parameters.faults {
            FaultKind::Hostile => HOSTILE_DRIFT_PPM,
            _ => ClusterParameters::default().drift_ppm_max,
        },
        ..ClusterParameters::default()
    };
    // A slow process gets round to what it was sent a little later still.
    let margin = network.latency_max + network.delay_max + Duration::from_millis(120);
    let mut watch = Watch::new(cluster_parameters.agent.lease, margin);
    let mut cluster = Cluster::of_agents(
        &problem,
        cluster_parameters,
        random.below(u64::MAX),
        parameters.agents.clone(),
    );
    if parameters.transcripts {
        cluster.keep_transcript();
    }
    for fault in &faults {
        if let Strike::StartLate(module) = fault.strike {
            cluster.start_late(module, fault.at);
        }
    }
    cluster.announce_problem(&problem, 1);
    let mut quiet_from = Duration::ZERO;
    for fault in &faults {
        run_to(&mut cluster, &mut watch, fault.at);
        strike(&mut cluster, &fault.strike, parameters, &problem)?;
        quiet_from = quiet_from.max(fault.at + fault.strike.span());
    }
    let limit = quiet_from + parameters.patience;
    let mut ended: Option<(Ending, Duration)> = None;
    while cluster.now() < limit {
        let next = (cluster.now() + Duration::from_millis(250)).min(limit);
        run_to(&mut cluster, &mut watch, next);
        let ending = watch.ending(&cluster);
        ended = match ended {
            _ if ending == Ending::Neither => None,
            Some(since) if since.0 == ending => Some(since),
            _ => Some((ending, cluster.now())),
        };
        // What looks like the end may be the calm before somebody is missed, so it has to last.
        let lasting = parameters.calm(&faults);
        if ended.is_some_and(|(_, since)| cluster.now() >= since.max(quiet_from) + lasting) {
            break;
        }
    }
    if ended.is_none() {
        watch.judge_end(&cluster);
    }
    let (ending, since) = ended.unwrap_or((Ending::Neither, cluster.now()));
    Ok(RunReport {
        seed,
        modules: modules.len(),
        spots: problem.target().spots().len(),
        running: cluster.running().len(),
        ending,
        recovery: since.saturating_sub(quiet_from),
        messages: cluster.samples(),
        epochs: watch.epochs(),
        violations: watch.violations,
        transcript: cluster.transcript().clone(),
    })
}

fn run_to(cluster: &mut Cluster, watch: &mut Watch, time: Duration) {
    while cluster.step(time) {
        watch.look(cluster);
    }
    watch.look(cluster);
}

fn strike(
    cluster: &mut Cluster,
    strike: &Strike,
    parameters: &CampaignParameters,
    problem: &PlanningProblem,
) -> Result<(), CampaignError> {
    match strike {
        Strike::Crash(module) => cluster.crash(*module),
        Strike::Restart(module) => cluster.restart(*module),
        Strike::Pause(module, duration) => cluster.pause(*module, *duration),
        Strike::Slow { module, lag, span } => cluster.slow_down(*module, *lag, *span),
        Strike::Cut(aside) => cluster.cut(aside),
        Strike::Sever(links) => cluster.sever(links),
        Strike::Heal => cluster.heal(),
        Strike::Command(module, command) => cluster.command(*module, *command),
        Strike::Drive { module, broken } => cluster.break_drive(*module, *broken),
        Strike::StartLate(_) => {}
        Strike::ForgeClaims => cluster.forge_claims(),
        Strike::Withdraw => announce(cluster, None),
        Strike::Announce(seed) => {
            let target = match seed {
                // A scenario that was asked for keeps its target.
                Some(seed) if parameters.problem.is_none() => draw_target(problem, *seed)?,
                _ => Arc::clone(problem.target()),
            };
            announce(cluster, Some(target));
        }
    }
    Ok(())
}

fn announce(cluster: &mut Cluster, target: Option<Arc<Target>>) {
    if let Some(last) = cluster.announcement() {
        let announcement = TargetAnnouncement {
            revision: last.revision + 1,
            target,
            ..(**last).clone()
        };
        cluster.announce(announcement);
    }
}

/// Another target for the modules of a problem.
fn draw_target(problem: &PlanningProblem, seed: u64) -> Result<Arc<Target>, CampaignError> {
    let modules = problem.modules().len();
    let spots = (modules + 2 - Random::from_seed(seed).index(4)).max(1);
    let raw = formation::generate::generate(&GeneratorParameters::new(modules, spots, seed))?;
    Ok(Arc::clone(Scenario::try_from(raw)?.problem().target()))
}
