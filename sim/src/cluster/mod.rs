//! The cluster: agents with simulated drives, the events between them, and the faults that strike them.

mod delivery;
mod execution;
mod faults;
mod observation;
mod schedule;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::Arc;
use std::time::Duration;

use formation::generate::Random;
use formation::model::{Incarnation, Message, ModuleId, PlanningProblem, TargetAnnouncement};
use formation::protocol::{AgentParameters, Identity};

pub use observation::{Observation, Standing};
use schedule::{Happening, Scheduled};

use crate::network::{Channel, Network, NetworkParameters, Participant, Topic};
use crate::process::{AgentFactory, Process};
use crate::transcript::Transcript;

/// How a cluster is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusterParameters {
    /// The agents' time limits.
    pub agent: AgentParameters,
    /// How the network treats messages.
    pub network: NetworkParameters,
    /// The speed of the simulated drives.
    pub speed_units_per_s: f64,
    /// How often a drive reports its pose.
    pub drive_tick: Duration,
    /// The processes start within this time of each other.
    pub start_spread: Duration,
    /// By how many millionths a clock runs fast or slow at most.
    pub drift_ppm_max: u32,
}

impl Default for ClusterParameters {
    fn default() -> Self {
        Self {
            agent: AgentParameters::default(),
            network: NetworkParameters::default(),
            speed_units_per_s: 5.0,
            drive_tick: Duration::from_millis(100),
            start_spread: Duration::from_millis(500),
            drift_ppm_max: 200,
        }
    }
}

/// What outlives a process: the module's body.
#[derive(Clone)]
struct Remains {
    identity: Identity,
}

/// Many agents under virtual time.
pub struct Cluster {
    agents: AgentFactory,
    parameters: ClusterParameters,
    now: Duration,
    order: u64,
    queue: BinaryHeap<Reverse<Scheduled>>,
    network: Network,
    random: Random,
    processes: BTreeMap<ModuleId, Process>,
    remains: BTreeMap<ModuleId, Remains>,
    announcement: Option<Arc<TargetAnnouncement>>,
    /// The modules whose processes start later than the others.
    late: BTreeMap<ModuleId, Duration>,
    forges_claims: bool,
    samples: u64,
    /// Samples that could not pass a cut, in the order of writing.
    held: BTreeMap<Channel, Vec<(u64, Message)>>,
    /// The newest sample written on a depth-1 channel, so that readers may skip older ones.
    newest: BTreeMap<(Participant, Topic), u64>,
    observations: Vec<(Duration, Observation)>,
    transcript: Option<Transcript>,
}

impl Cluster {
    /// A cluster of the modules of a problem; nothing runs before [`Self::step`].
    #[must_use]
    pub fn new(problem: &PlanningProblem, parameters: ClusterParameters, seed: u64) -> Self {
        Self::of_agents(problem, parameters, seed, AgentFactory::default())
    }

    /// The same, of agents made in another way.
    #[must_use]
    pub fn of_agents(
        problem: &PlanningProblem,
        parameters: ClusterParameters,
        seed: u64,
        agents: AgentFactory,
    ) -> Self {
        let mut random = Random::from_seed(seed);
        let network_seed = random.below(u64::MAX);
        let mut cluster = Self {
            agents,
            parameters,
            now: Duration::ZERO,
            order: 0,
            queue: BinaryHeap::new(),
            network: Network::new(parameters.network, Random::from_seed(network_seed)),
            random,
            processes: BTreeMap::new(),
            remains: BTreeMap::new(),
            announcement: None,
            late: BTreeMap::new(),
            forges_claims: false,
            samples: 0,
            held: BTreeMap::new(),
            newest: BTreeMap::new(),
            observations: Vec::new(),
            transcript: None,
        };
        for module in problem.modules() {
            cluster.remains.insert(
                module.id,
                Remains {
                    identity: Identity {
                        module: module.id,
                        incarnation: Incarnation(0),
                        pose: module.pose,
                        links: module.links.clone(),
                        configuration: module.configuration,
                        leader: module.leader,
                    },
                },
            );
            let spread = u64::try_from(parameters.start_spread.as_micros()).unwrap_or(0);
            let at = Duration::from_micros(cluster.random.below(spread.max(1)));
            cluster.schedule(at, Happening::Start(module.id));
        }
        cluster
    }

    /// Keeps a transcript of the run from now on.
    pub fn keep_transcript(&mut self) {
        self.transcript = Some(Transcript::default());
    }

    /// The transcript so far; empty unless one is kept.
    #[must_use]
    pub fn transcript(&self) -> &Transcript {
        static EMPTY: Transcript = Transcript::new();
        self.transcript.as_ref().unwrap_or(&EMPTY)
    }

    /// The time in the cluster.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.now
    }

    /// Announces a target, as its publisher would.
    pub fn announce(&mut self, announcement: TargetAnnouncement) {
        let announcement = Arc::new(announcement);
        self.observe(Observation::Announced(Arc::clone(&announcement)));
        self.announcement = Some(Arc::clone(&announcement));
        self.broadcast(
            Participant::TargetPublisher,
            Topic::Target,
            &Message::Target(announcement),
        );
    }

    /// Announces the problem's own target to all of its modules.
    pub fn announce_problem(&mut self, problem: &PlanningProblem, revision: u64) {
        self.announce(TargetAnnouncement {
            revision,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: u32::try_from(problem.modules().len()).ok(),
        });
    }

    /// What was announced last, if anything.
    #[must_use]
    pub fn announcement(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.announcement.as_ref()
    }
}
