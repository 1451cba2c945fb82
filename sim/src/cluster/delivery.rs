//! Messages on their way to the readers of a cluster.

use std::collections::BTreeMap;
use std::sync::Arc;

use formation_model::{Message, ModuleId, SourceId};
use formation_protocol::Input;

use super::Cluster;
use super::schedule::{Delivery, Happening};
use crate::network::{Channel, Network, Participant, Topic};
use crate::observation::Observation;

/// The network and the samples that were written.
pub(super) struct Transport {
    pub(super) network: Network,
    /// The number of samples written so far.
    pub(super) samples: u64,
    /// The newest sample of each writer, so that readers of topics with depth 1 may skip older ones.
    newest: BTreeMap<(Participant, Topic), u64>,
    /// Samples that could not pass a cut, in the order of writing.
    held: BTreeMap<Channel, Vec<(u64, Message)>>,
}

impl Transport {
    pub(super) fn new(network: Network) -> Self {
        Self {
            network,
            samples: 0,
            newest: BTreeMap::new(),
            held: BTreeMap::new(),
        }
    }

    /// Drops what was sent to and by a process that has ended.
    pub(super) fn forget(&mut self, module: ModuleId) {
        self.network.forget(module);
        self.held.retain(|channel, _| {
            channel.from != Participant::Module(module) && channel.to != module
        });
    }

    /// Whether a sample of a topic that keeps one sample has been replaced by a newer one.
    pub(super) fn is_replaced(&self, channel: Channel, sample: u64) -> bool {
        let newest = self.newest.get(&(channel.from, channel.topic));
        channel.topic.depth() == 1 && newest.is_some_and(|&newest| newest > sample)
    }
}

impl Cluster {
    /// The participant that is no module, as the transport identifies it.
    pub(crate) const STRANGER: SourceId = SourceId(u128::MAX);
    /// The publisher of the target.
    const TARGET_PUBLISHER: SourceId = SourceId(u128::MAX - 1);

    /// The samples that writers keep for late readers.
    pub(crate) fn kept_samples(&self) -> impl Iterator<Item = (Participant, Topic, Message)> {
        let announced = self.announcement.iter().map(|announcement| {
            let message = Message::Target(Arc::clone(announcement));
            (Participant::TargetPublisher, Topic::Target, message)
        });
        let kept = self.processes.iter().flat_map(|(&writer, process)| {
            let topics = process.history.iter();
            topics.flat_map(move |(&topic, samples)| {
                let from = Participant::Module(writer);
                let samples = samples.iter();
                samples.map(move |(_, message)| (from, topic, message.clone()))
            })
        });
        announced.chain(kept)
    }

    /// The participant that a writer is, as the transport identifies it.
    pub(crate) fn source_of(&self, writer: Participant) -> SourceId {
        self.source(writer).unwrap_or(Self::TARGET_PUBLISHER)
    }

    /// The processes that run, each by its first module.
    pub(super) fn readers(&self) -> Vec<ModuleId> {
        let running = self.processes.keys().copied();
        running
            .filter(|&one| self.hosting.first(one) == one)
            .collect()
    }

    /// Whether what a participant sends now reaches another process, which this module stands for.
    pub(super) fn is_reached_by(&self, from: Participant, reader: ModuleId) -> bool {
        let is_own = match from {
            Participant::Module(writer) => self.hosting.first(writer) == reader,
            Participant::TargetPublisher => false,
        };
        let is_first = self.hosting.first(reader) == reader;
        is_first && !is_own && self.transport.network.connects(from, reader)
    }

    /// Sends a new reader the samples that writers keep for late readers.
    pub(super) fn catch_up(&mut self, to: ModuleId) {
        let mut kept = Vec::new();
        if let Some(announcement) = &self.announcement {
            let message = Message::Target(Arc::clone(announcement));
            let (from, topic) = (Participant::TargetPublisher, Topic::Target);
            let newest = self.transport.newest.get(&(from, topic));
            let sample = newest.copied().unwrap_or_default();
            kept.push((Channel { from, to, topic }, sample, message));
        }
        for (&writer, process) in &self.processes {
            if self.hosting.first(writer) == to {
                continue;
            }
            for (&topic, samples) in &process.history {
                for (sample, message) in samples {
                    let from = Participant::Module(writer);
                    kept.push((Channel { from, to, topic }, *sample, message.clone()));
                }
            }
        }
        for (channel, sample, message) in kept {
            self.send(channel, sample, message);
        }
    }

    pub(super) fn publish(&mut self, module: ModuleId, message: &Message) {
        let topic = Topic::of(message);
        self.observe(Observation::Published(module, message.clone()));
        self.broadcast(Participant::Module(module), topic, message);
        if let Message::Claim(claim) = message {
            self.forge(claim);
        }
    }

    pub(super) fn broadcast(&mut self, from: Participant, topic: Topic, message: &Message) {
        self.transport.samples += 1;
        let sample = self.transport.samples;
        self.transport.newest.insert((from, topic), sample);
        if let Participant::Module(writer) = from
            && topic.depth() > 0
            && let Some(process) = self.processes.get_mut(&writer)
        {
            let history = process.history.entry(topic).or_default();
            history.push((sample, message.clone()));
            let excess = history.len().saturating_sub(topic.depth());
            history.drain(..excess);
        }
        let own = match from {
            Participant::Module(writer) => Some(self.hosting.first(writer)),
            Participant::TargetPublisher => None,
        };
        for to in self.readers() {
            if own != Some(to) {
                self.send(Channel { from, to, topic }, sample, message.clone());
            } else if self.hosting.together(to).len() > 1 {
                let source = self.source(from);
                self.note_sighting(to, message);
                let message = message.clone();
                if let Some(process) = self.processes.get_mut(&to) {
                    process.inbox.add(Input::Message { source, message });
                }
            }
        }
    }

    /// The participant that a sample comes from, as the transport identifies it.
    pub(super) fn source(&self, writer: Participant) -> Option<SourceId> {
        let Participant::Module(module) = writer else {
            return None;
        };
        let module = self.hosting.first(module);
        let run = self.process_run_of(module)?;
        Some(SourceId(
            u128::from(module.0) << 64 | u128::from(run.incarnation.0),
        ))
    }

    pub(super) fn send(&mut self, channel: Channel, sample: u64, message: Message) {
        let Some(reader) = self.process_run_of(channel.to) else {
            return;
        };
        if !self.transport.network.connects(channel.from, channel.to) {
            if channel.topic.is_reliable() {
                let held = self.transport.held.entry(channel).or_default();
                held.push((sample, message));
                let excess = held.len().saturating_sub(channel.topic.depth());
                held.drain(..excess);
            }
            return;
        }
        let source = self.source(channel.from);
        let now = self.schedule.now;
        for at in self.transport.network.arrivals(now, channel) {
            let delivery = Delivery {
                channel,
                source,
                reader,
                sample,
                sent_at: now,
                message: message.clone(),
            };
            self.schedule.add(at, Happening::Deliver(delivery));
        }
    }

    /// Sends again what was held; what cannot pass yet remains held.
    pub(super) fn release(&mut self) {
        for (channel, samples) in std::mem::take(&mut self.transport.held) {
            for (sample, message) in samples {
                self.send(channel, sample, message);
            }
        }
    }
}
