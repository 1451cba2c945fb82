//! Clusters under step-by-step control of a test.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_generate::{GeneratorParameters, Grouping, generate_apart};
use formation_model::{
    ClosedRoster, Incarnation, Message, ModuleId, ModulePhase, PlanningModule, PlanningProblem,
    RosterMessage, Scenario, SpotId,
};
use formation_protocol::{Agent, AgentParameters, Event, Identity};
use formation_sim::{
    AgentFactory, CampaignParameters, Cluster, ClusterParameters, FaultKind, Observation,
    SeedReport, run_seed, run_seeds,
};

pub fn drawn(modules: usize, spots: usize, grouping: Grouping, seed: u64) -> PlanningProblem {
    let parameters = GeneratorParameters::new(modules, spots, seed).grouped(grouping);
    let raw = generate_apart(&parameters).unwrap();
    Scenario::try_from(raw).unwrap().problem().clone()
}

/// The same, with starts far beside the target: a module that starts late stands on no spot.
pub fn drawn_beside(
    modules: usize,
    spots: usize,
    grouping: Grouping,
    seed: u64,
) -> PlanningProblem {
    const BESIDE: f64 = 30.0;
    let parameters = GeneratorParameters::new(modules, spots, seed).grouped(grouping);
    let mut raw = generate_apart(&parameters).unwrap();
    let docked = raw.configurations.iter_mut();
    let docked = docked.flat_map(|configuration| &mut configuration.modules);
    for module in docked.chain(&mut raw.singletons) {
        module.x += BESIDE;
    }
    Scenario::try_from(raw).unwrap().problem().clone()
}

pub fn scenario(yaml: &str) -> PlanningProblem {
    Scenario::from_yaml(yaml).unwrap().problem().clone()
}

/// The agent of a module of a scenario, which starts without a store.
pub fn agent(module: &PlanningModule) -> Agent {
    let identity = Identity::of(module, Incarnation(1));
    Agent::new(identity, AgentParameters::default(), Duration::ZERO)
}

/// A cluster and all events in it.
pub struct Trial {
    pub cluster: Cluster,
    pub noted: Vec<(ModuleId, Event)>,
    pub rosters: Vec<Arc<ClosedRoster>>,
    /// When each epoch was convened.
    pub convened: Vec<Duration>,
}

impl Trial {
    pub fn new(problem: &PlanningProblem, seed: u64) -> Self {
        Self::with(problem, ClusterParameters::default(), seed)
    }

    pub fn with(problem: &PlanningProblem, parameters: ClusterParameters, seed: u64) -> Self {
        Self::of_agents(problem, parameters, seed, AgentFactory::default())
    }

    pub fn of_agents(
        problem: &PlanningProblem,
        parameters: ClusterParameters,
        seed: u64,
        agents: AgentFactory,
    ) -> Self {
        let mut cluster = Cluster::of_agents(problem, parameters, seed, agents);
        cluster.keep_transcript();
        cluster.announce_problem(problem, 1);
        Self {
            cluster,
            noted: Vec::new(),
            rosters: Vec::new(),
            convened: Vec::new(),
        }
    }

    fn collect(&mut self) {
        for (at, observation) in self.cluster.take_observations() {
            match observation {
                Observation::Noted(module, event) => {
                    if matches!(event, Event::Convened(..)) {
                        self.convened.push(at);
                    }
                    self.noted.push((module, event));
                }
                Observation::Published(_, Message::Roster(RosterMessage::Plan(roster))) => {
                    self.rosters.push(roster);
                }
                _ => {}
            }
        }
    }

    /// Runs until `done` holds, for at most ten minutes of the cluster's time.
    #[track_caller]
    pub fn until(&mut self, done: impl FnMut(&Cluster) -> bool) {
        let limit = self.cluster.now() + Duration::from_secs(600);
        let came = self.cluster.run_until(limit, done);
        self.collect();
        assert!(
            came,
            "no end within ten minutes:\n{}",
            self.cluster.transcript()
        );
    }

    /// Runs until all modules have formed in a later epoch.
    #[track_caller]
    pub fn until_formed_again(&mut self) {
        self.until_formed_after(self.newest_epoch());
    }

    /// Runs until all modules have formed in a later epoch than this one.
    #[track_caller]
    pub fn until_formed_after(&mut self, before: u64) {
        self.until(|cluster| cluster.has_formed() && newest_epoch(cluster) > before);
    }

    /// Lets these modules crash, takes their bodies away, and runs until all others have formed again.
    #[track_caller]
    pub fn until_formed_without(&mut self, lost: &[ModuleId]) {
        let before = self.newest_epoch();
        for &module in lost {
            self.cluster.crash(module);
            self.cluster.remove(module);
        }
        self.until_formed_after(before);
    }

    pub fn run_for(&mut self, duration: Duration) {
        let end = self.cluster.now() + duration;
        self.cluster.run_until(end, |_| false);
        self.collect();
    }

    /// A cluster whose modules do not know that their session is new, so that none sets off before the lease has passed.
    pub fn waiting_for_a_lease() -> ClusterParameters {
        ClusterParameters {
            is_new_session: false,
            ..ClusterParameters::default()
        }
    }

    pub fn newest_epoch(&self) -> u64 {
        newest_epoch(&self.cluster)
    }

    /// The settled modules with their spots.
    pub fn settled(&self) -> Vec<(ModuleId, SpotId)> {
        settled(&self.cluster)
    }

    pub fn spot_of(&self, module: ModuleId) -> Option<SpotId> {
        self.settled()
            .into_iter()
            .find(|&(one, _)| one == module)
            .map(|(_, spot)| spot)
    }

    pub fn in_phase(&self, phase: ModulePhase) -> Vec<ModuleId> {
        in_phase(&self.cluster, phase)
    }

    /// The spots that were last reported open.
    pub fn open_spots(&self) -> Option<Vec<SpotId>> {
        self.noted.iter().rev().find_map(|(_, event)| match event {
            Event::SpotsLeftOpen(spots) => Some(spots.clone()),
            _ => None,
        })
    }

    pub fn count(&self, wanted: impl Fn(&Event) -> bool) -> usize {
        self.noted.iter().filter(|(_, event)| wanted(event)).count()
    }
}

/// A cluster whose modules do not know that their session is new, so that none sets off before the lease has passed.
pub fn waiting_for_a_lease() -> ClusterParameters {
    ClusterParameters {
        is_new_session: false,
        ..ClusterParameters::default()
    }
}

pub fn newest_epoch(cluster: &Cluster) -> u64 {
    cluster
        .running()
        .into_iter()
        .filter_map(|module| cluster.standing(module)?.epoch)
        .map(|epoch| epoch.number)
        .max()
        .unwrap_or_default()
}

pub fn in_phase(cluster: &Cluster, phase: ModulePhase) -> Vec<ModuleId> {
    cluster
        .running()
        .into_iter()
        .filter(|&module| {
            cluster
                .standing(module)
                .is_some_and(|standing| standing.phase == phase)
        })
        .collect()
}

pub fn settled(cluster: &Cluster) -> Vec<(ModuleId, SpotId)> {
    in_phase(cluster, ModulePhase::Settled)
        .into_iter()
        .filter_map(|module| Some((module, cluster.standing(module)?.spot?)))
        .collect()
}

pub fn spots(settled: &[(ModuleId, SpotId)]) -> BTreeSet<SpotId> {
    settled.iter().map(|&(_, spot)| spot).collect()
}

pub fn ids(ids: &[u32]) -> BTreeSet<ModuleId> {
    ids.iter().copied().map(ModuleId).collect()
}

/// Whether these modules hold one plan that all of them have carried out.
pub fn hold_a_plan(cluster: &Cluster, modules: &BTreeSet<ModuleId>) -> bool {
    let standings = modules.iter().map(|&module| cluster.standing(module));
    let plans: BTreeSet<_> = standings
        .map(|standing| {
            standing
                .filter(|one| matches!(one.phase, ModulePhase::Settled | ModulePhase::Spare))?
                .digest
        })
        .collect();
    plans.len() == 1 && !plans.contains(&None)
}

/// Runs seeds of formations of these sizes, from the fewest to the most modules. They must be clean.
pub fn run_each(faults: FaultKind, [modules_min, modules_max]: [usize; 2], seeds: &[u64]) {
    let parameters = CampaignParameters {
        faults,
        modules_min,
        modules_max,
        ..CampaignParameters::default()
    };
    for &seed in seeds {
        run_all(&parameters, seed..seed + 1);
    }
}

/// Runs all seeds, which must be clean. Prints what is wrong, and the end of the smallest bad run.
pub fn run_all(parameters: &CampaignParameters, seeds: std::ops::Range<u64>) {
    let mut bad: Vec<SeedReport> = Vec::new();
    run_seeds(parameters, seeds, |report| {
        if !report.violations.is_empty() && bad.len() < 20 {
            bad.push(report);
        }
    })
    .unwrap();
    for report in &bad {
        println!(
            "seed {} ({} modules, {} spots, {} left):",
            report.seed, report.modules, report.spots, report.running
        );
        for violation in report.violations.iter().take(4) {
            println!(
                "  {:.3} s {}: {}",
                violation.at.as_secs_f64(),
                violation.kind,
                violation.detail
            );
        }
    }
    if let Some(first) = bad.iter().min_by_key(|report| report.modules) {
        let parameters = CampaignParameters {
            transcripts: true,
            ..parameters.clone()
        };
        println!(
            "the end of seed {}:\n{}",
            first.seed,
            tail(
                &run_seed(&parameters, first.seed)
                    .unwrap()
                    .transcript
                    .to_string()
            )
        );
    }
    assert!(bad.is_empty(), "{} bad seeds", bad.len());
}

fn tail(transcript: &str) -> String {
    let lines: Vec<&str> = transcript.lines().collect();
    lines[lines.len().saturating_sub(60)..].join("\n")
}
