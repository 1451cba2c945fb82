//! Runs of many seeds: each draws a scenario, a network and faults, and is judged by the monitor of invariants.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_generate::{Apart, GenerateError, GeneratorParameters, Grouping, Random, set_apart};
use formation_model::{
    Message, ModuleId, PlanningProblem, Scenario, ScenarioError, Target, TargetAnnouncement,
};
use formation_protocol::AgentParameters;
use formation_verify::Violation as Breach;

use crate::cluster::{Cluster, ClusterParameters, Stores};
use crate::faults::{CarryMoment, Fault, FaultKind, ScheduledFault, draw, draw_processes};
use crate::monitor::{BrokenInvariant, Monitor};
use crate::network::NetworkParameters;
use crate::observation::Observation;
use crate::obstacles::add_obstacles;
use crate::process::AgentFactory;
use crate::transcript::Transcript;
use crate::verifier::{LINGER, Verifier};

/// Two clocks that drift apart by twice this are just within the tolerance of the agents.
const HOSTILE_DRIFT_PPM: u32 = 480;

/// What a slow disk takes to write at most.
const SLOW_STORE: Duration = Duration::from_millis(800);

/// How long a hand waits for the moment at which it takes a module.
const MOMENT_LIMIT: Duration = Duration::from_secs(60);

/// Separates the draw of the memories from that of the scenario.
const MEMORY_SEED: u64 = 0x6d65_6d6f_7279;

/// Separates what the verifier receives from what the modules receive.
const VERIFIER_SEED: u64 = 0x7665_7269_6679;

/// Separates the draw of who shares a process from that of the scenario.
const PROCESSES_SEED: u64 = 0x7072_6f63_6573;

/// The parameters of every run of a campaign.
#[derive(Clone)]
pub struct CampaignParameters {
    /// The kinds of faults.
    pub faults: FaultKind,
    /// The fewest modules of a drawn scenario.
    pub modules_min: usize,
    /// The most modules of a drawn scenario.
    pub modules_max: usize,
    /// The scenario to run instead of drawn ones.
    pub problem: Option<Arc<PlanningProblem>>,
    /// How the modules of drawn scenarios start apart, and the width of their field in hundredths of the square root of their number.
    pub apart: (Apart, u32),
    /// The time from the start within which faults occur; churn takes four times as long.
    pub fault_span: Duration,
    /// The time after the last fault within which a run must end.
    pub patience: Duration,
    /// Whether the modules have stores; drawn for each run if `None`. Most runs know that their session is new.
    pub stores: Option<bool>,
    /// Whether to keep the transcript of each run.
    pub transcripts: bool,
    /// If set, agents ask their host for plans, and each plan takes up to this time.
    pub plan_time_max: Option<Duration>,
    /// If set, drives move on for up to this time after their last goal, and so slowly that a step takes a second.
    pub coasting: Option<Duration>,
    /// If set, hands take modules only at this moment.
    pub moment: Option<CarryMoment>,
    /// Whether one to four modules share a process in half of the runs, or each has its own in all.
    pub shared_processes: bool,
    /// Makes the agents.
    pub agents: AgentFactory,
}

impl Default for CampaignParameters {
    fn default() -> Self {
        Self {
            faults: FaultKind::Mixed,
            modules_min: 5,
            modules_max: 40,
            problem: None,
            apart: (Apart::Circles, 300),
            fault_span: Duration::from_secs(40),
            patience: Duration::from_secs(900),
            stores: None,
            transcripts: false,
            plan_time_max: None,
            coasting: None,
            moment: None,
            shared_processes: true,
            agents: AgentFactory::default(),
        }
    }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All running modules hold one plan and have carried it out; those that are cut off from a majority report it.
    Formed,
    /// Too few modules can reach each other to decide anything, and they report it.
    WaitingForQuorum,
    /// Neither, within the patience.
    Neither,
}

/// The outcome of one seed.
#[derive(Clone, Debug)]
pub struct SeedReport {
    /// The seed.
    pub seed: u64,
    /// The number of modules.
    pub modules: usize,
    /// The number of spots of the target.
    pub spots: usize,
    /// The number of modules running at the end.
    pub running: usize,
    /// How it ended.
    pub ending: Ending,
    /// The time from the end of the last fault, or from the start without faults, to the state in which the run ended.
    pub recovery: Duration,
    /// The number of published messages, heartbeats included.
    pub messages: u64,
    /// The number of epochs with a roster.
    pub epochs: u64,
    /// Every violation of an invariant, and where the verdicts of the verifier contradict what was seen.
    pub violations: Vec<BrokenInvariant>,
    /// The violations that the verifier reported.
    pub reported: Vec<Breach>,
    /// The transcript, if it was kept.
    pub transcript: Transcript,
    /// The messages that modules published but for heartbeats, each with its time, if the transcript was kept.
    pub published: Vec<(Duration, Message)>,
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
    let mut raw = formation_generate::generate(&generator)?;
    // Modules do not set off where bodies touch.
    let (apart, percent) = parameters.apart;
    set_apart(&mut raw, apart, percent, random.below(u64::MAX));
    if parameters.faults.is_of_robots() {
        // In a third of the runs.
        let mut walls = Random::from_seed(random.below(u64::MAX));
        if walls.below(3) == 0 {
            add_obstacles(&mut raw, &mut walls);
        }
    }
    Ok(Scenario::try_from(raw)?.problem().clone())
}

/// The properties of the cluster of a run.
fn cluster_parameters(faults: FaultKind) -> ClusterParameters {
    let defaults = ClusterParameters::default();
    ClusterParameters {
        // Agents that recover quickly, so that runs are short; the ratios are those of the defaults.
        agent: AgentParameters {
            gather_limit: Duration::from_secs(15),
            motion_limit: Duration::from_secs(60),
            ..defaults.agent
        },
        network: match faults {
            FaultKind::Mixed
            | FaultKind::Hostile
            | FaultKind::Storm
            | FaultKind::Churn
            | FaultKind::Clocks => NetworkParameters::rough(),
            _ => defaults.network,
        },
        drift_ppm_max: match faults {
            FaultKind::Hostile => HOSTILE_DRIFT_PPM,
            _ => defaults.drift_ppm_max,
        },
        ..defaults
    }
}

/// Runs one seed.
///
/// # Errors
/// Why no scenario could be made of the parameters.
pub fn run_seed(parameters: &CampaignParameters, seed: u64) -> Result<SeedReport, CampaignError> {
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
    let mut memory = Random::from_seed(seed ^ MEMORY_SEED);
    let drawn = memory.below(2) == 0;
    let stores = parameters.stores.unwrap_or(drawn);
    let others = cluster_parameters(parameters.faults);
    let is_of_hosts = parameters.faults == FaultKind::Hosts;
    let is_slow = is_of_hosts && memory.below(4) == 0;
    let is_mixed = is_of_hosts && stores && memory.below(2) == 0;
    let cluster_parameters = ClusterParameters {
        stores: match (stores, is_mixed) {
            (false, _) => Stores::None,
            (true, false) => Stores::All,
            (true, true) => Stores::OfEven,
        },
        is_new_session: memory.below(4) > 0,
        write_max: if is_slow {
            SLOW_STORE
        } else {
            others.write_max
        },
        plan_time_max: parameters.plan_time_max,
        coasting: parameters.coasting,
        speed_units_per_s: match parameters.coasting {
            Some(_) => 1.0,
            None => others.speed_units_per_s,
        },
        ..others
    };
    let network = cluster_parameters.network;
    // A slow process handles its messages a little later still.
    let margin = network.latency_max + network.delay_max + Duration::from_millis(120);
    let agents = parameters.agents.clone();
    let mut cluster =
        Cluster::of_agents(&problem, cluster_parameters, random.below(u64::MAX), agents);
    let mut processes = Random::from_seed(seed ^ PROCESSES_SEED);
    if parameters.shared_processes && processes.below(2) == 0 {
        let has_store = |module| cluster_parameters.stores.has(module);
        for process in draw_processes(&faults, &modules, has_store, &mut processes) {
            cluster.host_together(&process);
        }
    }
    if parameters.transcripts {
        cluster.keep_transcript();
    }
    let listening = Random::from_seed(seed ^ VERIFIER_SEED);
    let mut run = MonitoredRun {
        parameters,
        problem: &problem,
        monitor: Monitor::new(cluster_parameters.agent.lease, margin),
        verifier: Verifier::new(network, parameters.fault_span, listening),
        cluster,
        published: Vec::new(),
    };
    let quiet_from = run.apply(&faults)?;
    // Faults whose effects are detected late would make an early end a false one, so an end has to last.
    let calm = if faults.is_empty() {
        Duration::ZERO
    } else {
        2 * cluster_parameters.agent.suspicion
    };
    let (ending, since) = run.await_end(quiet_from, calm);
    let (messages, running) = (run.cluster.samples(), run.cluster.running().len());
    run.compare_verdicts();
    Ok(SeedReport {
        seed,
        modules: modules.len(),
        spots: problem.target().spots().len(),
        running,
        ending,
        recovery: since.saturating_sub(quiet_from),
        messages,
        epochs: run.monitor.epochs(),
        violations: run.monitor.violations,
        reported: run.verifier.reported(),
        transcript: run.cluster.transcript().clone(),
        published: run.published,
    })
}

/// A cluster, the monitor of its invariants, and the verifier that judges it by its messages.
struct MonitoredRun<'a> {
    parameters: &'a CampaignParameters,
    problem: &'a PlanningProblem,
    cluster: Cluster,
    monitor: Monitor,
    verifier: Verifier,
    published: Vec<(Duration, Message)>,
}

impl MonitoredRun<'_> {
    /// Announces the target and applies all faults; returns when the last of them ends.
    fn apply(&mut self, faults: &[ScheduledFault]) -> Result<Duration, CampaignError> {
        for fault in faults {
            if let Fault::StartLate(module) = fault.fault {
                self.cluster.start_late(module, fault.at);
            }
        }
        self.cluster.announce_problem(self.problem, 1);
        let mut quiet_from = Duration::ZERO;
        for fault in faults {
            self.run_to(fault.at);
            self.apply_one(&fault.fault)?;
            let at = self.cluster.now();
            quiet_from = quiet_from.max(at + fault.fault.span());
        }
        Ok(quiet_from)
    }

    /// Runs until an end has lasted for `calm`, or the patience ends; returns the ending and when it was reached.
    fn await_end(&mut self, quiet_from: Duration, calm: Duration) -> (Ending, Duration) {
        let limit = quiet_from + self.parameters.patience;
        let mut reached = (Ending::Neither, self.cluster.now());
        while self.cluster.now() < limit {
            let next = (self.cluster.now() + Duration::from_millis(250)).min(limit);
            self.run_to(next);
            let ending = self.monitor.ending(&self.cluster);
            if ending != reached.0 {
                reached = (ending, self.cluster.now());
            }
            let has_lasted = self.cluster.now() >= reached.1.max(quiet_from) + calm;
            if ending != Ending::Neither && has_lasted && self.cluster.has_started() {
                return reached;
            }
        }
        if reached.0 == Ending::Neither {
            self.monitor.judge_end(&self.cluster);
            reached.1 = self.cluster.now();
        }
        reached
    }

    fn run_to(&mut self, time: Duration) {
        while self.cluster.step(time) {
            self.observe();
        }
        self.observe();
        self.verifier.advance(self.cluster.now(), &self.cluster);
    }

    /// Runs until a module is at a moment, for a while.
    fn await_moment(&mut self, moment: CarryMoment, module: ModuleId) {
        let limit = self.cluster.now() + MOMENT_LIMIT;
        while !self.cluster.is_at(moment, module) && self.cluster.step(limit) {
            self.observe();
        }
        self.observe();
    }

    fn observe(&mut self) {
        let observations = self.cluster.take_observations();
        for (at, observation) in &observations {
            self.verifier.observe(*at, observation, &self.cluster);
            if self.parameters.transcripts
                && let Observation::Published(_, message) = observation
                && !matches!(message, Message::Heartbeat(_))
            {
                self.published.push((*at, message.clone()));
            }
        }
        self.monitor.observe(observations, &self.cluster);
    }

    /// Records where the verdicts contradict what the monitor saw, once the verifier has received the last messages.
    fn compare_verdicts(&mut self) {
        self.verifier.join(self.cluster.now());
        self.run_to(self.cluster.now() + LINGER);
        let has_formed = self.monitor.ending(&self.cluster) == Ending::Formed
            && self.cluster.parts().iter().skip(1).all(BTreeSet::is_empty);
        let seen = std::mem::take(&mut self.monitor.violations);
        let found = self.verifier.conclude(&self.cluster, has_formed, &seen);
        self.monitor.violations = seen;
        self.monitor.violations.extend(found);
    }

    fn apply_one(&mut self, fault: &Fault) -> Result<(), CampaignError> {
        let cluster = &mut self.cluster;
        match fault {
            Fault::Crash(module) => cluster.crash(*module),
            Fault::Restart(module) => cluster.restart(*module),
            Fault::Remove { module, takes_vote } => cluster.remove_with(*module, *takes_vote),
            Fault::SetClock(module, ahead) => cluster.set_clock_ahead(*module, *ahead),
            Fault::Pause(module, span) => cluster.pause(*module, *span),
            Fault::Suspend(module, span) => cluster.suspend(*module, *span),
            Fault::Slow { module, lag, span } => cluster.slow_down(*module, *lag, *span),
            Fault::Cut(aside) => cluster.cut(aside),
            Fault::Sever(links) => cluster.sever(links),
            Fault::Heal => cluster.heal(),
            Fault::Command(module, command) => cluster.command(*module, *command),
            Fault::Drive { module, broken } => cluster.break_drive(*module, *broken),
            Fault::SilentDriver(module) => cluster.mute_drive(*module),
            Fault::Carry {
                module,
                moment,
                with_docked,
                way,
            } => {
                let moment = self.parameters.moment.unwrap_or(*moment);
                self.await_moment(moment, *module);
                self.cluster.carry(*module, *with_docked, *way);
            }
            Fault::Mislead(module, way) => cluster.mislead(*module, *way),
            Fault::Stop(stop) => {
                if let Some(&module) = cluster.running().first() {
                    cluster.stop(module, *stop);
                }
            }
            Fault::StartLate(_) => {}
            Fault::ForgeClaims => cluster.forge_claims(),
            Fault::ForgeRoster => cluster.forge_roster(),
            Fault::Withdraw => announce(cluster, None),
            Fault::Announce(seed) => {
                let target = match seed {
                    // A given scenario keeps its target.
                    Some(seed) if self.parameters.problem.is_none() => {
                        draw_target(self.problem, *seed)?
                    }
                    _ => Arc::clone(self.problem.target()),
                };
                announce(cluster, Some(target));
            }
        }
        Ok(())
    }
}

/// Announces another target under the next revision, or withdraws the target.
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
    let raw = formation_generate::generate(&GeneratorParameters::new(modules, spots, seed))?;
    Ok(Arc::clone(Scenario::try_from(raw)?.problem().target()))
}
