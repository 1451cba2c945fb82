//! How messages reach the readers of a cluster.

use std::sync::Arc;

use formation::model::{Message, ModuleId};
use formation::protocol::SourceId;

use super::schedule::Happening;
use super::{Cluster, Observation};
use crate::network::{Channel, Participant, Topic};

impl Cluster {
    /// Sends a new reader what the writers keep for those who come late.
    pub(super) fn catch_up(&mut self, reader: ModuleId) {
        let mut kept = Vec::new();
        if let Some(announcement) = &self.announcement {
            let message = Message::Target(Arc::clone(announcement));
            let writer = (Participant::TargetPublisher, Topic::Target);
            let sample = self.newest.get(&writer).copied().unwrap_or_default();
            kept.push((writer.0, writer.1, sample, message));
        }
        for (&writer, process) in &self.processes {
            if writer == reader {
                continue;
            }
            for (&topic, samples) in &process.history {
                for (sample, message) in samples {
                    kept.push((Participant::Module(writer), topic, *sample, message.clone()));
                }
            }
        }
        for (from, topic, sample, message) in kept {
            self.send(
                Channel {
                    from,
                    to: reader,
                    topic,
                },
                sample,
                message,
            );
        }
    }

    pub(super) fn publish(&mut self, module: ModuleId, message: &Message) {
        let topic = match message {
            Message::Target(_) => Topic::Target,
            Message::ModuleState(_) => Topic::ModuleStates,
            Message::Roster(_) => Topic::Roster,
            Message::Claim(_) => Topic::Claims,
            Message::Eviction(_) => Topic::Evictions,
            Message::Heartbeat(_) => Topic::Heartbeats,
        };
        self.observe(Observation::Published(module, message.clone()));
        self.broadcast(Participant::Module(module), topic, message);
        if let Message::Claim(claim) = message {
            self.forge(claim);
        }
    }

    pub(super) fn broadcast(&mut self, from: Participant, topic: Topic, message: &Message) {
        self.samples += 1;
        let sample = self.samples;
        self.newest.insert((from, topic), sample);
        if let Participant::Module(writer) = from
            && topic.depth() > 0
            && let Some(process) = self.processes.get_mut(&writer)
        {
            let history = process.history.entry(topic).or_default();
            history.push((sample, message.clone()));
            let excess = history.len().saturating_sub(topic.depth());
            history.drain(..excess);
        }
        let readers: Vec<ModuleId> = self
            .processes
            .keys()
            .copied()
            .filter(|&reader| from != Participant::Module(reader))
            .collect();
        for to in readers {
            self.send(Channel { from, to, topic }, sample, message.clone());
        }
    }

    /// What the transport tells of a writer.
    fn source(&self, writer: Participant) -> Option<SourceId> {
        let Participant::Module(module) = writer else {
            return None;
        };
        let run = self.processes.get(&module)?.incarnation;
        Some(SourceId(u128::from(module.0) << 64 | u128::from(run.0)))
    }

    pub(super) fn send(&mut self, channel: Channel, sample: u64, message: Message) {
        let Some(reader) = self
            .processes
            .get(&channel.to)
            .map(|process| process.incarnation)
        else {
            return;
        };
        if !self.network.connects(channel.from, channel.to) {
            if channel.topic.is_reliable() {
                let held = self.held.entry(channel).or_default();
                held.push((sample, message));
                let excess = held.len().saturating_sub(channel.topic.depth());
                held.drain(..excess);
            }
            return;
        }
        let source = self.source(channel.from);
        for at in self.network.arrivals(self.now, channel) {
            self.schedule(
                at,
                Happening::Deliver {
                    channel,
                    source,
                    reader,
                    sample,
                    message: message.clone(),
                },
            );
        }
    }
}
