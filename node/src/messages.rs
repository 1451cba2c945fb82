//! Samples of the protocol's topics as messages of the core.

use std::sync::Arc;

use formation::model::{Message, RosterMessage};
use formation::protocol::SourceId;
use formation_msgs::{
    Eviction, Heartbeat, InSession, MessageError, ModuleStates, OperatorCommand, Roster, SessionId,
    SpotClaim, TargetConfiguration,
};
use futures::stream::LocalBoxStream;
use ros_runtime::session::{ParticipantId, Session, SessionError};
use ros_runtime::topic::Topic;
use serde::de::DeserializeOwned;

use crate::{stamp, topics};

/// The messages of one sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// The name under which the topic's samples are counted.
    pub topic: &'static str,
    /// The participant that sent it.
    pub source: SourceId,
    /// The messages, one for each module that the sample lists.
    pub messages: Vec<Message>,
}

/// The session to which the messages of a node belong.
#[must_use]
pub fn session_of(session: &Session) -> SessionId {
    SessionId(session.node_parameters().session.unwrap_or_default().into())
}

/// A sample type whose samples carry messages of the core.
pub trait Sample: InSession + DeserializeOwned + 'static {
    /// The messages of one sample, or what is wrong with it; a sample is accepted whole or not at all.
    ///
    /// # Errors
    /// Names the field that is wrong.
    fn into_messages(self) -> Result<Vec<Message>, MessageError>;

    /// What a sample of another session means to modules; `None` if it is refused.
    fn into_other_session_messages(self) -> Option<Result<Vec<Message>, MessageError>> {
        None
    }
}

macro_rules! samples {
    ($($sample:ty => |$raw:ident| $convert:expr $(, $other_session:expr)?;)+) => {
        $(impl Sample for $sample {
            fn into_messages(self) -> Result<Vec<Message>, MessageError> {
                let $raw = self;
                $convert
            }

            $(fn into_other_session_messages(self) -> Option<Result<Vec<Message>, MessageError>> {
                let convert: fn(Self) -> Result<Vec<Message>, MessageError> = $other_session;
                Some(convert(self))
            })?
        })+
    };
}

samples! {
    TargetConfiguration => |raw| Ok(vec![Message::Target(Arc::new(raw.try_into()?))]);
    Roster => |raw| Ok(vec![Message::Roster(raw.try_into()?)]);
    SpotClaim => |raw| Ok(vec![Message::Claim(Arc::new(raw.try_into()?))]);
    Eviction => |raw| Ok(vec![Message::Eviction(raw.try_into()?)]);
    ModuleStates => |raw| {
        let states = Vec::try_from(raw)?.into_iter();
        Ok(states.map(|state| Message::ModuleState(Arc::new(state))).collect())
    }, |raw| {
        let states = Vec::try_from(raw)?.into_iter();
        Ok(states.map(|state| Message::OtherSessionState(Arc::new(state))).collect())
    };
    OperatorCommand => |raw| raw.try_into(), |raw| match raw.session() {
        SessionId::EVERY => raw.try_into(),
        _ => Ok(Vec::new()),
    };
    Heartbeat => |raw| Ok(Vec::try_from(raw)?.into_iter().map(Message::Heartbeat).collect());
}

/// A participant, as the core knows it.
#[must_use]
pub fn source_id(participant: ParticipantId) -> SourceId {
    SourceId(participant.0)
}

/// The messages of a sample, if it belongs to this node's session or means something to all.
fn accepted<M: Sample>(sample: M, ours: SessionId) -> Result<Vec<Message>, String> {
    let theirs = sample.session();
    let messages = if theirs == ours {
        Some(sample.into_messages())
    } else {
        sample.into_other_session_messages()
    };
    let messages = match messages {
        Some(messages) => messages.map_err(|error| error.to_string())?,
        None => return Err(format!("it belongs to {theirs}, and this node to {ours}")),
    };
    match messages.iter().find_map(implausible_revision) {
        Some(revision) => Err(format!(
            "revision {revision} is too far ahead of this clock"
        )),
        None => Ok(messages),
    }
}

/// The revision of the target in a message, if none could follow it for too long a time: the highest one applies.
fn implausible_revision(message: &Message) -> Option<u64> {
    let revision = match message {
        Message::Target(announcement) => announcement.revision,
        Message::Roster(RosterMessage::Plan(roster)) => roster.target.revision,
        _ => return None,
    };
    (revision > stamp::latest()).then_some(revision)
}

/// Subscribes one topic of the protocol.
///
/// # Errors
/// The name cannot be used, or the library refuses.
pub fn subscribe<M: Sample>(
    session: &mut Session,
    topic: &Topic<M>,
) -> Result<LocalBoxStream<'static, Received>, SessionError> {
    let name = topic.name();
    let ours = session_of(session);
    session.subscription(topic, move |sender, sample: M| {
        let messages = accepted(sample, ours)?;
        Ok(Received {
            topic: name,
            source: source_id(sender),
            messages,
        })
    })
}

/// Subscribes one topic of the protocol, whatever the session of its samples.
///
/// # Errors
/// The name cannot be used, or the library refuses.
pub fn subscribe_every_session<M: Sample>(
    session: &mut Session,
    topic: &Topic<M>,
) -> Result<LocalBoxStream<'static, Received>, SessionError> {
    let name = topic.name();
    session.subscription(topic, move |sender, sample: M| {
        let messages = sample.into_messages().map_err(|error| error.to_string())?;
        Ok(Received {
            topic: name,
            source: source_id(sender),
            messages,
        })
    })
}

/// Subscribes the topics that the protocol needs: target, states, rosters, claims and heartbeats. The process hosts
/// `modules` modules.
///
/// # Errors
/// A name cannot be used, or the library refuses.
pub fn subscribe_all(
    session: &mut Session,
    modules: usize,
) -> Result<[LocalBoxStream<'static, Received>; 5], SessionError> {
    Ok([
        subscribe(session, &topics::TARGET)?,
        subscribe(session, &topics::MODULE_STATES)?,
        subscribe(session, &topics::ROSTER)?,
        subscribe(session, &topics::claims(modules))?,
        subscribe(session, &topics::HEARTBEATS)?,
    ])
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use formation::model::{Incarnation, ModuleId, ModulePhase, Stop};

    use super::*;

    fn heartbeat(module: u32) -> formation::model::Heartbeat {
        formation::model::Heartbeat {
            store: None,
            module: ModuleId(module),
            incarnation: Incarnation(1),
            sequence: 1,
            uptime: Duration::from_secs(1),
            epoch: None,
            digest: None,
            digest_since: 0,
            applied_turns: 0,
            steps_done: 0,
            phase: ModulePhase::Listening,
            stop: Stop::default(),
        }
    }

    #[test]
    fn a_sample_carries_one_message_for_each_module() {
        let (one, two) = (heartbeat(1), heartbeat(2));
        let messages = Heartbeat::new([&one, &two]).into_messages();
        assert_eq!(
            messages,
            Ok(vec![Message::Heartbeat(one), Message::Heartbeat(two)])
        );
    }

    #[test]
    fn a_sample_of_another_session_is_refused_by_name() {
        let of = |session| Heartbeat::new([&heartbeat(1)]).in_session(SessionId(session));
        assert_eq!(accepted(of(4), SessionId(4)).unwrap().len(), 1);
        assert_eq!(
            accepted(of(3), SessionId(4)),
            Err("it belongs to session 3, and this node to session 4".to_owned())
        );
    }

    #[test]
    fn a_target_of_a_revision_that_none_can_follow_is_refused() {
        let of = |revision| TargetConfiguration {
            revision,
            withdrawn: true,
            ..TargetConfiguration::default()
        };
        let own = SessionId(0);
        assert!(accepted(of(stamp::revision()), own).is_ok());
        let refused = accepted(of(u64::MAX), own).unwrap_err();
        assert!(refused.contains("too far ahead of this clock"), "{refused}");
    }

    #[test]
    fn a_contradictory_sample_is_refused_whole() {
        let one = heartbeat(1);
        assert!(Heartbeat::new([&one, &one]).into_messages().is_err());
    }
}
