//! The seeded network: how long each message takes, which are lost, and which modules reach each other.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation_generate::Random;
use formation_model::{Message, ModuleId};

/// The network's treatment of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkParameters {
    /// The least time that a message takes.
    pub latency_min: Duration,
    /// The greatest time that a message takes, unless it is delayed.
    pub latency_max: Duration,
    /// The number of best-effort messages in a thousand that are lost.
    pub loss_per_mille: u64,
    /// The number of messages in a thousand that come twice.
    pub duplication_per_mille: u64,
    /// The number of reliable messages in a thousand that are delayed, as by retransmission.
    pub delay_per_mille: u64,
    /// The greatest delay.
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
    /// A network that loses, repeats and delays messages.
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

/// A writer.
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
    Commands,
}

impl Topic {
    pub fn of(message: &Message) -> Self {
        match message {
            Message::Target(_) => Self::Target,
            Message::ModuleState(_) | Message::OtherSessionState(_) => Self::ModuleStates,
            Message::Roster(_) => Self::Roster,
            Message::Claim(_) => Self::Claims,
            Message::Eviction(_) => Self::Evictions,
            Message::Heartbeat(_) => Self::Heartbeats,
            Message::Stop(_) | Message::Removal(_) => Self::Commands,
        }
    }

    /// Whether messages are repeated until they arrive, in order.
    pub fn is_reliable(self) -> bool {
        self != Self::Heartbeats
    }

    /// The number of samples that a writer keeps for late readers.
    pub fn depth(self) -> usize {
        match self {
            Self::Target | Self::ModuleStates | Self::Roster | Self::Commands => 1,
            Self::Claims | Self::Evictions => 10_000,
            Self::Heartbeats => 0,
        }
    }
}

/// Draws when each message arrives, and whether.
pub(crate) struct Network {
    parameters: NetworkParameters,
    random: Random,
    /// The modules that are cut off from the others.
    aside: BTreeSet<ModuleId>,
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
            aside: BTreeSet::new(),
            severed: BTreeSet::new(),
            last_arrival: BTreeMap::new(),
        }
    }

    pub fn cut(&mut self, aside: &BTreeSet<ModuleId>) {
        self.aside.clone_from(aside);
    }

    pub fn sever(&mut self, links: &BTreeSet<(ModuleId, ModuleId)>) {
        self.severed.clone_from(links);
    }

    pub fn heal(&mut self) {
        self.aside.clear();
        self.severed.clear();
    }

    /// Whether a message can pass now. The target's publisher is on the side without a cut.
    pub fn connects(&self, from: Participant, to: ModuleId) -> bool {
        let is_aside = |module: ModuleId| self.aside.contains(&module);
        match from {
            Participant::TargetPublisher => !is_aside(to),
            Participant::Module(from) => {
                is_aside(from) == is_aside(to) && !self.severed.contains(&(from, to))
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
        let spread = parameters
            .latency_max
            .saturating_sub(parameters.latency_min);
        let mut at = now + parameters.latency_min + duration_below(&mut self.random, spread);
        if reliable {
            if self.chance(parameters.delay_per_mille) {
                at += duration_below(&mut self.random, parameters.delay_max);
            }
            let last = self.last_arrival.entry(channel).or_default();
            at = at.max(*last + Duration::from_nanos(1));
            *last = at;
        }
        let mut arrivals = vec![at];
        if self.chance(parameters.duplication_per_mille) {
            arrivals.push(at + duration_below(&mut self.random, parameters.latency_max));
        }
        arrivals
    }

    fn chance(&mut self, per_mille: u64) -> bool {
        per_mille > 0 && self.random.below(1_000) < per_mille
    }
}

/// A random duration below `bound`, in whole microseconds.
pub(crate) fn duration_below(random: &mut Random, bound: Duration) -> Duration {
    let micros = u64::try_from(bound.as_micros()).unwrap_or(u64::MAX);
    Duration::from_micros(random.below(micros.max(1)))
}
