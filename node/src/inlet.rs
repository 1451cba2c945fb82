//! Taking in what others publish: bytes become validated messages, or a counted refusal.

use formation::model::Message;
use formation::protocol::SourceId;
use formation_msgs::{
    Eviction, Heartbeat, MessageError, ModuleStates, Roster, SpotClaim, TargetConfiguration,
};
use futures::StreamExt;
use futures::stream::LocalBoxStream;
use ros_runtime::inlet::Inlet;
use ros_runtime::session::ParticipantId;
use ros_runtime::traffic::{RefusalKind, Traffic};
use serde::de::DeserializeOwned;

/// A sample type whose samples carry messages of the core.
pub trait Carrier: DeserializeOwned + 'static {
    /// The messages of one sample, or what is wrong with it; a sample is taken whole or not at all.
    fn into_messages(self) -> Result<Vec<Message>, MessageError>;
}

macro_rules! carriers {
    ($($sample:ty => |$raw:ident| $convert:expr;)+) => {
        $(impl Carrier for $sample {
            fn into_messages(self) -> Result<Vec<Message>, MessageError> {
                let $raw = self;
                $convert
            }
        })+
    };
}

carriers! {
    TargetConfiguration => |raw| Ok(vec![Message::Target(std::sync::Arc::new(raw.try_into()?))]);
    Roster => |raw| Ok(vec![Message::Roster(raw.try_into()?)]);
    SpotClaim => |raw| Ok(vec![Message::Claim(std::sync::Arc::new(raw.try_into()?))]);
    Eviction => |raw| Ok(vec![Message::Eviction(raw.try_into()?)]);
    ModuleStates => |raw| Ok(Vec::try_from(raw)?
        .into_iter()
        .map(|state| Message::ModuleState(std::sync::Arc::new(state)))
        .collect());
    Heartbeat => |raw| Ok(Vec::try_from(raw)?.into_iter().map(Message::Heartbeat).collect());
}

/// What came in on one topic, not yet counted.
pub struct Delivery {
    topic: &'static str,
    content: Result<(SourceId, Vec<Message>), (RefusalKind, String)>,
}

impl Delivery {
    /// The topic on which it came.
    pub fn topic(&self) -> &'static str {
        self.topic
    }

    /// The messages and their sender; nothing of a sample that is refused, and nothing of one's own.
    ///
    /// A process hands messages between the modules that it hosts by itself, so what it hears of itself is no news.
    pub fn accept(self, own: SourceId, traffic: &mut Traffic) -> Option<(SourceId, Vec<Message>)> {
        match self.content {
            Ok((source, _)) if source == own => None,
            Ok(content) => {
                traffic.on(self.topic).received += 1;
                Some(content)
            }
            Err((kind, reason)) => {
                traffic.refuse(self.topic, kind, &reason);
                None
            }
        }
    }
}

/// A participant, as the core knows it.
#[must_use]
pub fn source_id(participant: ParticipantId) -> SourceId {
    SourceId(participant.0)
}

/// Everything that comes in, for ever.
pub fn deliveries<M: Carrier>(inlet: &Inlet<M>) -> LocalBoxStream<'_, Delivery> {
    let topic = inlet.topic();
    inlet
        .samples()
        .map(move |taken| Delivery {
            topic,
            content: match taken {
                Ok((participant, sample)) => sample
                    .into_messages()
                    .map(|messages| (source_id(participant), messages))
                    .map_err(|error| (RefusalKind::Invalid, error.to_string())),
                Err(error) => Err((RefusalKind::Malformed, error)),
            },
        })
        .boxed_local()
}

#[cfg(test)]
mod tests {
    use formation::model::{Incarnation, ModuleId, ModulePhase};

    use super::*;

    fn heartbeat(module: u32) -> formation::model::Heartbeat {
        formation::model::Heartbeat {
            module: ModuleId(module),
            incarnation: Incarnation(1),
            sequence: 1,
            uptime: std::time::Duration::from_secs(1),
            epoch: None,
            digest: None,
            digest_since: 0,
            applied_turns: 0,
            phase: ModulePhase::Listening,
        }
    }

    fn delivery(sample: Heartbeat) -> Delivery {
        Delivery {
            topic: "heartbeats",
            content: sample
                .into_messages()
                .map(|messages| (SourceId(7), messages))
                .map_err(|error| (RefusalKind::Invalid, error.to_string())),
        }
    }

    #[test]
    fn a_sample_carries_one_message_for_each_module() {
        let (one, two) = (heartbeat(1), heartbeat(2));
        let mut traffic = Traffic::default();
        let (source, messages) = delivery(Heartbeat::new([&one, &two]))
            .accept(SourceId(1), &mut traffic)
            .unwrap();
        assert_eq!(source, SourceId(7));
        assert_eq!(messages, [Message::Heartbeat(one), Message::Heartbeat(two)]);
        assert_eq!(traffic.topics()["heartbeats"].received, 1);
    }

    #[test]
    fn a_contradictory_sample_is_counted_and_goes_no_further() {
        let one = heartbeat(1);
        let mut traffic = Traffic::default();
        let twice = delivery(Heartbeat::new([&one, &one]));
        assert!(twice.accept(SourceId(1), &mut traffic).is_none());
        let counts = &traffic.topics()["heartbeats"];
        assert_eq!(counts.received, 0);
        assert_eq!(counts.refused[&RefusalKind::Invalid], 1);
    }

    #[test]
    fn what_a_process_hears_of_itself_is_no_news() {
        let one = heartbeat(1);
        let mut traffic = Traffic::default();
        let own = delivery(Heartbeat::new([&one]));
        assert!(own.accept(SourceId(7), &mut traffic).is_none());
        assert!(traffic.topics().is_empty());
    }
}
