//! The verifier in a simulated run: an observer that receives what its own part of the network brings it.
//!
//! Its reader is on the side of a cut where the publisher of the target is. It reviews its verdict as a verifier does that keeps
//! watching, and in the end its verdicts are compared with what the monitor saw, which looks into every process and drive.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation_generate::Random;
use formation_model::text::joined;
use formation_model::{BODY_WIDTH, Epoch, Message, ModuleId, SourceId};
use formation_verify::{
    Admission, Observer, ObserverParameters, Outcome, SourceGuard, Verdict, Violation as Breach,
};

use crate::cluster::Cluster;
use crate::faults::Fault;
use crate::monitor::{BrokenInvariant, ViolationKind};
use crate::network::{Channel, Network, NetworkParameters, Participant, Topic, duration_below};
use crate::observation::Observation;

/// The reader of the verifier on the network; no module has this identifier.
const READER: ModuleId = ModuleId(0);

/// How often it reviews its verdict.
const REVIEW_INTERVAL: Duration = Duration::from_secs(1);

/// The time within which a formation must be done after its target was announced, as the verifier has it by default.
const TIME_LIMIT: Duration = Duration::from_secs(60);

/// How long a formation stands before its last verdict: the time that the last heartbeats and links take.
pub(crate) const LINGER: Duration = Duration::from_secs(8);

/// How many breaches a report lists.
const BREACHES_SHOWN: usize = 3;

/// A sample on its way to the verifier.
struct Arrival {
    channel: Channel,
    sample: u64,
    source: SourceId,
    message: Message,
}

/// A sample that could not pass a cut.
type Held = (u64, SourceId, Message);

/// The verifier of one run.
pub(crate) struct Verifier {
    network: Network,
    random: Random,
    /// It starts at this time, and receives then what writers keep for late readers.
    joins_at: Duration,
    has_joined: bool,
    arrivals: BTreeMap<(Duration, u64), Arrival>,
    /// The number of entries so far.
    order: u64,
    /// The number of samples sent to it.
    samples: u64,
    /// The newest sample of each channel.
    newest: BTreeMap<Channel, u64>,
    held: BTreeMap<Channel, Vec<Held>>,
    source_guard: SourceGuard<SourceId>,
    observer: Observer,
    reviews_at: Duration,
    /// When it first reported each breach.
    reported: BTreeMap<Breach, Duration>,
    /// Whether it reported bodies that did meet.
    has_met: bool,
    /// The docked parts that hands have torn apart, whose members may run into each other until they halt.
    torn: Vec<BTreeSet<ModuleId>>,
    /// The modules whose machines were suspended, and in which epochs: it takes their clocks for running, and so their steps for too
    /// early.
    suspended: BTreeSet<(ModuleId, Epoch)>,
}

impl Verifier {
    /// A quarter of all verifiers join late, within `span`.
    pub fn new(network: NetworkParameters, span: Duration, mut random: Random) -> Self {
        let network_seed = random.below(u64::MAX);
        let joins_at = match random.below(4) {
            0 => duration_below(&mut random, span),
            _ => Duration::ZERO,
        };
        Self {
            network: Network::new(network, Random::from_seed(network_seed)),
            random,
            joins_at,
            has_joined: false,
            arrivals: BTreeMap::new(),
            order: 0,
            samples: 0,
            newest: BTreeMap::new(),
            held: BTreeMap::new(),
            source_guard: SourceGuard::default(),
            observer: Observer::new(ObserverParameters {
                time_limit: TIME_LIMIT,
                ..ObserverParameters::default()
            }),
            reviews_at: REVIEW_INTERVAL,
            reported: BTreeMap::new(),
            has_met: false,
            torn: Vec::new(),
            suspended: BTreeSet::new(),
        }
    }

    /// It joins now at the latest.
    pub fn join(&mut self, now: Duration) {
        self.joins_at = self.joins_at.min(now);
    }

    /// Sends it what was published. What has arrived by then it receives first: a sample that is newer only later replaces none of it.
    pub fn observe(&mut self, at: Duration, observation: &Observation, cluster: &Cluster) {
        self.advance(at, cluster);
        match observation {
            Observation::Fault(Fault::Cut(aside)) => {
                self.network.cut(aside);
                self.release(at);
            }
            Observation::Torn(part) => self.torn.push(part.clone()),
            Observation::Fault(Fault::Suspend(module, _)) => {
                let epoch = cluster.standing(*module).and_then(|it| it.epoch);
                self.suspended.extend(epoch.map(|epoch| (*module, epoch)));
            }
            Observation::Fault(Fault::Heal) => {
                self.network.heal();
                self.release(at);
            }
            Observation::Fault(Fault::Crash(module)) => {
                self.network.forget(*module);
                let writer = Participant::Module(*module);
                self.held.retain(|channel, _| channel.from != writer);
            }
            _ => {}
        }
        if !self.has_joined {
            if at < self.joins_at {
                return;
            }
            self.has_joined = true;
            for (from, topic, message) in cluster.kept_samples() {
                let source = cluster.source_of(from);
                self.send(at, channel(from, topic), 0, source, message.clone());
            }
        }
        let (from, source, message) = match observation {
            Observation::Published(module, message) => {
                let from = Participant::Module(*module);
                (from, cluster.source_of(from), message.clone())
            }
            Observation::Announced(announcement) => {
                let from = Participant::TargetPublisher;
                let message = Message::Target(announcement.clone());
                (from, cluster.source_of(from), message)
            }
            Observation::Injected(message) => {
                // No cut keeps a stranger away.
                let from = Participant::TargetPublisher;
                (from, Cluster::STRANGER, message.clone())
            }
            _ => return,
        };
        let channel = channel(from, Topic::of(&message));
        self.samples += 1;
        if source != Cluster::STRANGER {
            self.newest.insert(channel, self.samples);
        }
        self.send(at, channel, self.samples, source, message);
    }

    fn send(
        &mut self,
        now: Duration,
        channel: Channel,
        sample: u64,
        source: SourceId,
        message: Message,
    ) {
        if !self.network.connects(channel.from, READER) {
            if channel.topic.is_reliable() {
                let held = self.held.entry(channel).or_default();
                held.push((sample, source, message));
                let excess = held.len().saturating_sub(channel.topic.depth());
                held.drain(..excess);
            }
            return;
        }
        for at in self.network.arrivals(now, channel) {
            self.order += 1;
            let arrival = Arrival {
                channel,
                sample,
                source,
                message: message.clone(),
            };
            self.arrivals.insert((at, self.order), arrival);
        }
    }

    fn release(&mut self, now: Duration) {
        for (channel, samples) in std::mem::take(&mut self.held) {
            for (sample, source, message) in samples {
                self.send(now, channel, sample, source, message);
            }
        }
    }

    /// Receives what arrives until now, and reviews its verdict at the times that are due.
    pub fn advance(&mut self, now: Duration, cluster: &Cluster) {
        while self.reviews_at <= now {
            let at = self.reviews_at;
            self.reviews_at += REVIEW_INTERVAL;
            self.receive(at);
            if at < self.joins_at {
                continue;
            }
            if let Some(verdict) = self.observer.review(at) {
                let breaches = verdict.violations.clone();
                self.note(at, breaches, cluster);
            }
        }
        self.receive(now);
    }

    /// Whether a breach may be due to a clock that stood still in its epoch.
    fn is_of_sleeper(&self, breach: &Breach) -> bool {
        let (epoch, modules) = match *breach {
            Breach::WaitNotKept {
                epoch,
                module,
                other,
                ..
            } => (epoch, [module, other]),
            Breach::BodiesOverlap {
                epoch,
                first,
                second,
                ..
            } => (epoch, [first, second]),
            _ => return false,
        };
        let mut modules = modules.into_iter();
        modules.any(|module| self.suspended.contains(&(module, epoch)))
    }

    /// Records what a verdict reports. Where bodies have met, which the monitor judges by itself, the verdict is right.
    fn note(&mut self, at: Duration, breaches: Vec<Breach>, cluster: &Cluster) {
        for breach in breaches {
            if self.is_of_sleeper(&breach) {
                continue;
            }
            let has_met = match breach {
                Breach::TwoBodies { first, second, .. } => {
                    let bodies = cluster.body(first).zip(cluster.body(second));
                    bodies.is_some_and(|(first, second)| first.distance_to(&second) < BODY_WIDTH)
                }
                Breach::BodiesOverlap { first, second, .. } => {
                    let mut torn = self.torn.iter();
                    torn.any(|part| part.contains(&first) && part.contains(&second))
                }
                _ => false,
            };
            if has_met {
                self.has_met = true;
            } else {
                self.reported.entry(breach).or_insert(at);
            }
        }
    }

    /// The violations that it reported.
    pub fn reported(&self) -> Vec<Breach> {
        self.reported.keys().cloned().collect()
    }

    /// Where its verdicts contradict what the monitor has seen in the run. `has_formed` says that all modules hold one formation and
    /// can reach the verifier.
    pub fn conclude(
        &mut self,
        cluster: &Cluster,
        has_formed: bool,
        seen: &[BrokenInvariant],
    ) -> Option<BrokenInvariant> {
        let now = cluster.now();
        // What is on its way arrives before the last verdict.
        let end = self.arrivals.last_key_value().map(|(&(at, _), _)| at);
        let end = end.map_or(now, |last| last.max(now));
        self.receive(end);
        let verdict = self.observer.final_verdict(end);
        self.note(end, verdict.violations.clone(), cluster);
        let (kind, detail) = if seen.is_empty() {
            (
                ViolationKind::FalseVerdict,
                self.false_verdict(&verdict, has_formed)?,
            )
        } else {
            (
                ViolationKind::MissedByVerifier,
                self.missed(&verdict, seen)?,
            )
        };
        Some(BrokenInvariant {
            at: now,
            kind,
            detail,
        })
    }

    /// What it reported although no invariant was violated.
    fn false_verdict(&self, verdict: &Verdict, has_formed: bool) -> Option<String> {
        if let Some(first) = self.reported.values().min() {
            let breaches = self
                .reported
                .iter()
                .map(|(breach, at)| format!("{breach} ({:.3} s)", at.as_secs_f64()));
            let count = self.reported.len();
            let listed = joined(breaches.take(BREACHES_SHOWN), "; ");
            return Some(format!(
                "{count} from {:.3} s on: {listed}",
                first.as_secs_f64()
            ));
        }
        let mut breaches = verdict.violations.iter();
        let is_excused = self.has_met || breaches.any(|breach| self.is_of_sleeper(breach));
        let is_failed = has_formed && !is_excused && verdict.outcome == Outcome::Failed;
        is_failed.then(|| format!("missing: {}", joined(&verdict.missing, "; ")))
    }

    /// What it did not report although messages show it.
    fn missed(&self, verdict: &Verdict, seen: &[BrokenInvariant]) -> Option<String> {
        let is_satisfied = self.reported.is_empty() && verdict.outcome != Outcome::Failed;
        let has_all = self.joins_at == Duration::ZERO
            && verdict.counts.missed_states == 0
            && verdict.counts.dropped == 0
            && verdict.counts.unproven == 0;
        let mut shown = seen.iter();
        let shown = shown.find(|violation| violation.kind.is_shown_by_messages())?;
        (is_satisfied && has_all).then(|| format!("{}: {}", shown.kind, shown.detail))
    }

    fn receive(&mut self, until: Duration) {
        while let Some(next) = self.arrivals.first_entry()
            && next.key().0 <= until
        {
            let ((at, _), arrival) = next.remove_entry();
            let Arrival {
                channel,
                sample,
                source,
                message,
            } = arrival;
            let newest = self.newest.get(&channel);
            let is_replaced =
                channel.topic.depth() == 1 && newest.is_some_and(|&newest| newest > sample);
            if is_replaced && self.random.below(2) == 0 {
                continue;
            }
            if self.source_guard.admit(source, &message) == Admission::Accepted {
                self.observer.handle(at, &message);
            }
            for roster in self.source_guard.released() {
                self.observer.handle(at, &roster);
            }
        }
    }
}

fn channel(from: Participant, topic: Topic) -> Channel {
    Channel {
        from,
        to: READER,
        topic,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use formation_generate::{GeneratorParameters, generate};
    use formation_model::{Incarnation, ModuleState, Pose, Scenario};

    use super::*;
    use crate::cluster::ClusterParameters;

    /// A reader may miss a state that a newer one has replaced on its way, and none that arrived before.
    #[test]
    fn a_state_that_arrives_before_the_next_one_is_published_is_received() {
        let raw = generate(&GeneratorParameters::new(2, 2, 0)).unwrap();
        let problem = Scenario::try_from(raw).unwrap().problem().clone();
        let cluster = Cluster::new(&problem, ClusterParameters::default(), 0);
        let pose = Pose::from_units(0.0, 0.0, 0.0).unwrap();
        let publish = |verifier: &mut Verifier, seconds, sequence| {
            let state = ModuleState {
                sequence,
                ..ModuleState::standing(ModuleId(1).run(Incarnation(1)), pose)
            };
            let message = Message::ModuleState(Arc::new(state));
            let observation = Observation::Published(ModuleId(1), message);
            verifier.observe(Duration::from_secs(seconds), &observation, &cluster);
        };
        for seed in 0..16 {
            let random = Random::from_seed(seed);
            let mut verifier = Verifier::new(NetworkParameters::rough(), Duration::ZERO, random);
            for sequence in 1..=8 {
                publish(&mut verifier, 2 * sequence, sequence);
            }
            let end = Duration::from_secs(20);
            verifier.advance(end, &cluster);
            let verdict = verifier.observer.final_verdict(end);
            assert_eq!(verdict.counts.missed_states, 0, "seed {seed}");
        }
    }
}
