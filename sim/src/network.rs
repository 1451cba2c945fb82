//! The seeded network: how long each message takes, which are lost, and who can hear whom.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation::generate::Random;
use formation::model::ModuleId;

/// How the network treats messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkParameters {
    /// The least time that a message takes.
    pub latency_min: Duration,
    /// The greatest time that a message takes, unless it is delayed.
    pub latency_max: Duration,
    /// How many best-effort messages in a thousand are lost.
    pub loss_per_mille: u64,
    /// How many messages in a thousand come twice.
    pub duplication_per_mille: u64,
    /// How many reliable messages in a thousand are delayed, as by retransmission.
    pub delay_per_mille: u64,
    /// By how much at most.
    pub delay_max: Duration,
}

impl Default for NetworkParameters {
    fn default() -> Self {
        Self {
            latency_min: Duration::from_micros(200),
            latency_max: Duration::from_millis(5),
            loss_per_mille: 0,
            duplication_per_mille: 0,
            delay_per_mille: 0,
            delay_max: Duration::ZERO,
        }
    }
}

impl NetworkParameters {
    /// A network that loses, repeats and delays.
    #[must_use]
    pub fn rough() -> Self {
        Self {
            latency_max: Duration::from_millis(60),
            loss_per_mille: 100,
            duplication_per_mille: 50,
            delay_per_mille: 50,
            delay_max: Duration::from_millis(800),
            ..Self::default()
        }
    }
}

/// A channel from one participant to another for one kind of message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Channel {
    pub from: Participant,
    pub to: ModuleId,
    pub topic: Topic,
}

/// Who writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Participant {
    /// The process that announces the target.
    TargetPublisher,
    /// A module's process.
    Module(ModuleId),
}

/// The topics, as far as their quality of service differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Topic {
    Target,
    ModuleStates,
    Roster,
    Claims,
    Evictions,
    Heartbeats,
}

impl Topic {
    /// Whether messages are repeated until they arrive, in order.
    pub fn is_reliable(self) -> bool {
        self != Self::Heartbeats
    }

    /// How many samples a writer keeps for those who come late.
    pub fn depth(self) -> usize {
        match self {
            Self::Target | Self::ModuleStates | Self::Roster => 1,
            Self::Claims | Self::Evictions => 10_000,
            Self::Heartbeats => 0,
        }
    }
}

/// Draws the fate of each message.
pub(crate) struct Network {
    parameters: NetworkParameters,
    random: Random,
    /// The side of a cut on which each module stands; all on side 0 when there is none.
    sides: BTreeMap<ModuleId, u32>,
    /// The links that carry nothing in one direction: from the first module to the second.
    severed: BTreeSet<(ModuleId, ModuleId)>,
    /// When the latest message of a reliable channel arrives: none overtakes it.
    last_arrival: BTreeMap<Channel, Duration>,
}

impl Network {
    pub fn new(parameters: NetworkParameters, random: Random) -> Self {
        Self {
            parameters,
            random,
            sides: BTreeMap::new(),
            severed: BTreeSet::new(),
            last_arrival: BTreeMap::new(),
        }
    }

    pub fn cut(&mut self, aside: &BTreeSet<ModuleId>) {
        self.sides = aside.iter().map(|&module| (module, 1)).collect();
    }

    pub fn sever(&mut self, links: &BTreeSet<(ModuleId, ModuleId)>) {
        self.severed.clone_from(links);
    }

    pub fn heal(&mut self) {
        self.sides.clear();
        self.severed.clear();
    }

    /// Whether a message can pass now. The target's publisher is on the side of most.
    pub fn connects(&self, from: Participant, to: ModuleId) -> bool {
        let side = |module: ModuleId| self.sides.get(&module).copied().unwrap_or(0);
        match from {
            Participant::TargetPublisher => side(to) == 0,
            Participant::Module(from) => {
                side(from) == side(to) && !self.severed.contains(&(from, to))
            }
        }
    }

    pub fn forget(&mut self, module: ModuleId) {
        self.last_arrival.retain(|channel, _| {
            channel.to != module && channel.from != Participant::Module(module)
        });
    }

    /// When a message that is sent now arrives; empty when it is lost, two entries when it comes twice.
    pub fn arrivals(&mut self, now: Duration, channel: Channel) -> Vec<Duration> {
        let parameters = self.parameters;
        let reliable = channel.topic.is_reliable();
        if !reliable && self.chance(parameters.loss_per_mille) {
            return Vec::new();
        }
        let mut at = now
            + parameters.latency_min
            + self.up_to(
                parameters
                    .latency_max
                    .saturating_sub(parameters.latency_min),
            );
        if reliable {
            if self.chance(parameters.delay_per_mille) {
                at += self.up_to(parameters.delay_max);
            }
            let last = self.last_arrival.entry(channel).or_default();
            at = at.max(*last + Duration::from_nanos(1));
            *last = at;
        }
        let mut arrivals = vec![at];
        if self.chance(parameters.duplication_per_mille) {
            arrivals.push(at + self.up_to(parameters.latency_max));
        }
        arrivals
    }

    fn chance(&mut self, per_mille: u64) -> bool {
        per_mille > 0 && self.random.below(1_000) < per_mille
    }

    fn up_to(&mut self, longest: Duration) -> Duration {
        let micros = u64::try_from(longest.as_micros()).unwrap_or(u64::MAX);
        Duration::from_micros(self.random.below(micros.max(1)))
    }
}
