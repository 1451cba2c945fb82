//! The cluster: agents with simulated drives, the messages between them, and their faults.

mod delivery;
mod execution;
mod faults;
mod hands;
mod hosting;
mod observer;
mod schedule;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use formation_generate::Random;
use formation_model::{
    Incarnation, Message, ModuleId, ModuleRun, PlanningProblem, TargetAnnouncement,
};
use formation_protocol::{AgentParameters, Identity};

use delivery::Transport;
use hosting::Hosting;
use observer::Record;
pub use observer::Standing;
use schedule::{Happening, Schedule};

use crate::network::{Network, NetworkParameters, Participant, Topic, duration_below};
use crate::observation::Observation;
use crate::process::{AgentFactory, Process, Stored};
use crate::transcript::Transcript;

/// Which modules have stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stores {
    /// None.
    None,
    /// All.
    All,
    /// Those with even identifiers.
    OfEven,
}

impl Stores {
    pub(crate) fn has(self, module: ModuleId) -> bool {
        match self {
            Self::None => false,
            Self::All => true,
            Self::OfEven => module.0.is_multiple_of(2),
        }
    }
}

/// The properties of a cluster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusterParameters {
    /// The agents' time limits.
    pub agent: AgentParameters,
    /// The network's treatment of messages.
    pub network: NetworkParameters,
    /// The speed of the simulated drives.
    pub speed_units_per_s: f64,
    /// The time between two reports of a moving drive.
    pub drive_tick: Duration,
    /// The processes start within this time of each other.
    pub start_spread: Duration,
    /// The greatest number of millionths by which a clock runs fast or slow.
    pub drift_ppm_max: u32,
    /// The modules with stores that outlive their processes.
    pub stores: Stores,
    /// A store takes less than this to write.
    pub write_max: Duration,
    /// Whether modules know at their first start that nothing was agreed in the session before.
    pub is_new_session: bool,
    /// If set, agents ask their host for plans, and each plan takes up to this time. Otherwise they compute them in no time.
    pub plan_time_max: Option<Duration>,
    /// If set, a drive moves on for up to this time after its last goal, as that of a robot does. Otherwise it halts with its agent.
    pub coasting: Option<Duration>,
    /// How long ports take to let go.
    pub undocking: Duration,
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
            stores: Stores::None,
            write_max: Duration::from_millis(50),
            is_new_session: true,
            plan_time_max: None,
            coasting: None,
            undocking: Duration::ZERO,
        }
    }
}

/// Many agents under virtual time.
pub struct Cluster {
    agents: AgentFactory,
    parameters: ClusterParameters,
    schedule: Schedule,
    transport: Transport,
    random: Random,
    processes: BTreeMap<ModuleId, Process>,
    hosting: Hosting,
    /// The modules as their last process left them; what outlives a process.
    bodies: BTreeMap<ModuleId, Identity>,
    /// What the store of each module holds.
    stores: BTreeMap<ModuleId, Stored>,
    /// The modules of which each run received a state, or knew from its store.
    sightings: BTreeMap<ModuleRun, BTreeSet<ModuleId>>,
    /// The runs that took a later number, and the same runs by the number at their start.
    renumbered: BTreeMap<ModuleRun, ModuleRun>,
    /// The crashed modules whose bodies were taken away.
    taken_away: BTreeSet<ModuleId>,
    announcement: Option<Arc<TargetAnnouncement>>,
    /// The modules whose processes start later than the others.
    late: BTreeMap<ModuleId, Duration>,
    /// The times that plans take where they are given.
    plan_times: BTreeMap<ModuleId, Duration>,
    forges_claims: bool,
    record: Record,
}

impl Cluster {
    /// A cluster of the modules of a problem; nothing runs before [`Self::step`].
    #[must_use]
    pub fn new(problem: &PlanningProblem, parameters: ClusterParameters, seed: u64) -> Self {
        Self::of_agents(problem, parameters, seed, AgentFactory::default())
    }

    /// Starts a cluster whose agents come from this factory.
    #[must_use]
    pub fn of_agents(
        problem: &PlanningProblem,
        parameters: ClusterParameters,
        seed: u64,
        agents: AgentFactory,
    ) -> Self {
        let mut random = Random::from_seed(seed);
        let network_seed = random.below(u64::MAX);
        let network = Network::new(parameters.network, Random::from_seed(network_seed));
        let mut cluster = Self {
            agents,
            parameters,
            schedule: Schedule::default(),
            transport: Transport::new(network),
            random,
            processes: BTreeMap::new(),
            hosting: Hosting::default(),
            bodies: BTreeMap::new(),
            stores: BTreeMap::new(),
            sightings: BTreeMap::new(),
            renumbered: BTreeMap::new(),
            taken_away: BTreeSet::new(),
            announcement: None,
            late: BTreeMap::new(),
            plan_times: BTreeMap::new(),
            forges_claims: false,
            record: Record::default(),
        };
        for module in problem.modules() {
            let body = Identity {
                has_store: parameters.stores.has(module.id),
                is_first_run: parameters.is_new_session,
                ..Identity::of(module, Incarnation(0))
            };
            cluster.bodies.insert(module.id, body);
            let at = duration_below(&mut cluster.random, parameters.start_spread);
            cluster.schedule.add(at, Happening::Start(module.id));
        }
        cluster
    }

    /// Keeps a transcript of the run from now on.
    pub fn keep_transcript(&mut self) {
        self.record.keeps_transcript = true;
    }

    /// The transcript so far; empty unless one is kept.
    #[must_use]
    pub fn transcript(&self) -> &Transcript {
        &self.record.transcript
    }

    /// The time in the cluster.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.schedule.now
    }

    /// Whether all processes that start with the run have started.
    #[must_use]
    pub fn has_started(&self) -> bool {
        self.now() >= self.parameters.start_spread
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

    /// Announces the problem's own target to all modules, which all vote.
    pub fn announce_problem(&mut self, problem: &PlanningProblem, revision: u64) {
        self.announce(TargetAnnouncement {
            revision,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: u32::try_from(problem.modules().len()).ok(),
            voters: problem.modules().iter().map(|module| module.id).collect(),
        });
    }

    /// The last announcement, if any.
    #[must_use]
    pub fn announcement(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.announcement.as_ref()
    }
}
