//! Samples of the protocol's topics as messages of the core.

use std::sync::Arc;
use std::time::Duration;

use formation_model::{Message, ModuleSize, RosterMessage, SourceId};
use formation_msgs::{
    Eviction, Heartbeat, InSession, IntoCore, MessageError, ModuleStates, OperatorCommand, Roster,
    SessionId, SpotClaim, TargetConfiguration, Time, Verdict,
};
use futures::stream::LocalBoxStream;
use ros_runtime::cdr;
use ros_runtime::ros_context::{ParticipantId, RosContext, RosContextError, SampleOrigin};
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
    /// How long after it was made the sample was sent, if too long for one whose maker sends it: it is played from a
    /// recording.
    pub replayed_after: Option<Duration>,
    /// The messages, one for each module that the sample lists.
    pub messages: Vec<Message>,
}

/// Between the stamp of a sample and its sending there is less time; both are times of the clock of one process. Whoever makes a
/// recording and plays it at once takes longer; a script that waits for subscribers with a sample in hand seldom does.
const SENDING_MAX: Duration = Duration::from_secs(3);
/// Stamps before this time since 1970 are times of a simulation.
const WALL_CLOCK_MIN: Duration = Duration::from_secs(1_000_000_000);

/// By how much a sample was sent later than its stamp says, if it is a recorded one: a player sends recorded bytes at a new
/// time. `None` as well where sample or middleware tell no wall-clock time.
fn replayed_after(stamp: Option<Time>, origin: &SampleOrigin) -> Option<Duration> {
    let Time { sec, nanosec } = stamp?;
    let made = Duration::new(u64::try_from(sec).ok()?, nanosec);
    let sent = Duration::from_nanos(origin.sent_ns?);
    let after = sent.checked_sub(made)?;
    (made >= WALL_CLOCK_MIN && after > SENDING_MAX).then_some(after)
}

/// The session to which the messages of a node belong.
#[must_use]
pub fn session_of(ros: &RosContext) -> SessionId {
    SessionId(ros.node_parameters().session.unwrap_or_default().into())
}

/// The size of the modules of a node's formation.
#[must_use]
pub fn module_size_of(ros: &RosContext) -> ModuleSize {
    let metres = ros.node_parameters().module_size;
    // The range of the parameter excludes others.
    metres.map_or_else(ModuleSize::default, |metres| {
        ModuleSize::from_metres(metres).unwrap_or_default()
    })
}

/// A sample type whose samples carry messages of the core.
pub trait Sample: InSession + DeserializeOwned + 'static {
    /// The messages of one sample for modules of this size, or what is wrong with it; a sample is accepted whole or not at
    /// all.
    ///
    /// # Errors
    /// Names the field that is wrong.
    fn into_messages(self, size: ModuleSize) -> Result<Vec<Message>, MessageError>;

    /// When the sample was made, if its type says so.
    fn stamp(&self) -> Option<Time> {
        None
    }

    /// What a sample of another session means to modules of this size; `None` if it is refused.
    fn into_other_session_messages(
        self,
        _size: ModuleSize,
    ) -> Option<Result<Vec<Message>, MessageError>> {
        None
    }
}

macro_rules! samples {
    ($($sample:ty $([$header:ident])? => |$raw:ident, $size:ident| $convert:expr $(, $other_session:expr)?;)+) => {
        $(impl Sample for $sample {
            fn into_messages(self, $size: ModuleSize) -> Result<Vec<Message>, MessageError> {
                let $raw = self;
                $convert
            }

            $(fn stamp(&self) -> Option<Time> {
                Some(self.$header.stamp)
            })?

            $(fn into_other_session_messages(
                self,
                size: ModuleSize,
            ) -> Option<Result<Vec<Message>, MessageError>> {
                let convert: fn(Self, ModuleSize) -> Result<Vec<Message>, MessageError> =
                    $other_session;
                Some(convert(self, size))
            })?
        })+
    };
}

samples! {
    TargetConfiguration [header] => |raw, size| Ok(vec![Message::Target(Arc::new(raw.into_core(size)?))]);
    Roster => |raw, size| Ok(vec![Message::Roster(raw.into_core(size)?)]);
    SpotClaim => |raw, size| Ok(vec![Message::Claim(Arc::new(raw.into_core(size)?))]);
    Eviction => |raw, size| Ok(vec![Message::Eviction(raw.into_core(size)?)]);
    ModuleStates => |raw, size| {
        let states = raw.into_core(size)?.into_iter();
        Ok(states.map(|state| Message::ModuleState(Arc::new(state))).collect())
    }, |mut raw, size| {
        // The modules of another formation may have another size; where they stand is in metres.
        raw.module_size = size.metres();
        let states = raw.into_core(size)?.into_iter();
        Ok(states.map(|state| Message::OtherSessionState(Arc::new(state))).collect())
    };
    OperatorCommand => |raw, size| raw.into_core(size), |raw, size| match raw.session() {
        SessionId::EVERY => raw.into_core(size),
        _ => Ok(Vec::new()),
    };
    Heartbeat => |raw, size| {
        Ok(raw.into_core(size)?.into_iter().map(Message::Heartbeat).collect())
    };
}

/// A participant, as the core knows it.
#[must_use]
pub fn source_id(participant: ParticipantId) -> SourceId {
    SourceId(participant.0)
}

/// The messages of a sample for modules of this size, if it belongs to this node's session or means something to all.
/// Enforces C6.
fn accepted<M: Sample>(
    sample: M,
    ours: SessionId,
    size: ModuleSize,
) -> Result<Vec<Message>, String> {
    let theirs = sample.session();
    let messages = if theirs == ours {
        Some(sample.into_messages(size))
    } else {
        sample.into_other_session_messages(size)
    };
    let messages = match messages {
        Some(messages) => messages.map_err(|error| error.to_string())?,
        None => return Err(other_session(theirs, ours)),
    };
    match messages.iter().find_map(implausible_revision) {
        Some(revision) => Err(format!(
            "revision {revision} is too far ahead of this clock"
        )),
        None => Ok(messages),
    }
}

fn other_session(theirs: SessionId, ours: SessionId) -> String {
    format!("it belongs to {theirs}, and this node to {ours}")
}

/// The messages of an encoded sample, such as a recorded one, whatever its session, which is the other result, and its size.
///
/// # Errors
/// Says why the sample does not decode, or which field is wrong.
pub fn decode<M: Sample>(bytes: &[u8]) -> Result<(SessionId, Vec<Message>), String> {
    let sample: M = cdr::decoded(bytes)?;
    let (session, size) = (sample.session(), sample.module_size());
    Ok((session, accepted(sample, session, size)?))
}

/// The revision of the target in a message, if none could follow it for too long a time: the highest one applies.
/// Enforces E10.
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
    ros: &mut RosContext,
    topic: &Topic<M>,
) -> Result<LocalBoxStream<'static, Received>, RosContextError> {
    let name = topic.name();
    let (ours, size) = (session_of(ros), module_size_of(ros));
    ros.subscription(topic, move |origin, sample: M| {
        received(name, &origin, sample, ours, size)
    })
}

/// Subscribes one topic of the protocol for what has no lengths, whatever the size of modules in its samples; and, if the
/// node belongs to every session, whatever their session.
///
/// # Errors
/// The name cannot be used, or the library refuses.
pub fn subscribe_every_size<M: Sample>(
    ros: &mut RosContext,
    topic: &Topic<M>,
) -> Result<LocalBoxStream<'static, Received>, RosContextError> {
    let name = topic.name();
    let ours = session_of(ros);
    ros.subscription(topic, move |origin, sample: M| {
        let ours = match ours {
            SessionId::EVERY => sample.session(),
            ours => ours,
        };
        let size = sample.module_size();
        received(name, &origin, sample, ours, size)
    })
}

fn received<M: Sample>(
    topic: &'static str,
    origin: &SampleOrigin,
    sample: M,
    ours: SessionId,
    size: ModuleSize,
) -> Result<Received, String> {
    let replayed_after = replayed_after(sample.stamp(), origin);
    Ok(Received {
        topic,
        source: source_id(origin.participant),
        replayed_after,
        messages: accepted(sample, ours, size)?,
    })
}

/// Subscribes the topics that the protocol needs: target, states, rosters, claims and heartbeats. The process hosts
/// `modules` modules.
///
/// # Errors
/// A name cannot be used, or the library refuses.
pub fn subscribe_all(
    ros: &mut RosContext,
    modules: usize,
) -> Result<[LocalBoxStream<'static, Received>; 5], RosContextError> {
    Ok([
        subscribe(ros, &topics::TARGET)?,
        subscribe(ros, &topics::MODULE_STATES)?,
        subscribe(ros, &topics::ROSTER)?,
        subscribe(ros, &topics::claims(modules))?,
        subscribe(ros, &topics::HEARTBEATS)?,
    ])
}

/// Subscribes the verdicts on the formation of this node's session.
///
/// # Errors
/// The name cannot be used, or the library refuses.
pub fn subscribe_verdicts(
    ros: &mut RosContext,
) -> Result<LocalBoxStream<'static, Verdict>, RosContextError> {
    let ours = session_of(ros);
    ros.subscription(&topics::VERDICT, move |_, verdict| {
        accepted_verdict(verdict, ours)
    })
}

/// The verdict, if it is valid and of this node's session.
/// Enforces C6.
fn accepted_verdict(verdict: Verdict, ours: SessionId) -> Result<Verdict, String> {
    let theirs = verdict.session();
    if theirs != ours {
        return Err(other_session(theirs, ours));
    }
    verdict.judgement().map_err(|error| error.to_string())?;
    Ok(verdict)
}

#[cfg(test)]
mod tests {
    use formation_model::{Incarnation, ModuleId};

    use super::*;

    #[test]
    fn a_sample_that_was_sent_long_after_it_was_made_is_a_replayed_one() {
        let after = |sec, sent_s: Option<u64>| {
            let origin = SampleOrigin {
                participant: ParticipantId(1),
                sent_ns: sent_s.map(|seconds| seconds * 1_000_000_000),
            };
            replayed_after(Some(Time { sec, nanosec: 0 }), &origin)
        };
        let hour = Duration::from_secs(3_600);
        assert_eq!(after(1_800_000_000, Some(1_800_003_600)), Some(hour));
        // Fresh; sent before it was made; of a simulation, never stamped; sent at a time that is not told.
        assert_eq!(after(1_800_000_000, Some(1_800_000_003)), None);
        let four = Duration::from_secs(4);
        assert_eq!(after(1_800_000_000, Some(1_800_000_004)), Some(four));
        assert_eq!(after(1_800_000_000, Some(1_700_000_000)), None);
        assert_eq!(after(120, Some(1_800_000_000)), None);
        assert_eq!(after(0, Some(1_800_000_000)), None);
        assert_eq!(after(1_800_000_000, None), None);
        let unstamped = SampleOrigin {
            participant: ParticipantId(1),
            sent_ns: Some(0),
        };
        assert_eq!(replayed_after(None, &unstamped), None);
    }

    fn heartbeat(module: u32) -> formation_model::Heartbeat {
        formation_model::Heartbeat {
            uptime: Duration::from_secs(1),
            ..formation_model::Heartbeat::first(ModuleId(module).run(Incarnation(1)))
        }
    }

    #[test]
    fn a_sample_carries_one_message_for_each_module() {
        let (one, two) = (heartbeat(1), heartbeat(2));
        let size = ModuleSize::METRE;
        let messages = Heartbeat::new([&one, &two], size).into_messages(size);
        assert_eq!(
            messages,
            Ok(vec![Message::Heartbeat(one), Message::Heartbeat(two)])
        );
    }

    /// Shows C6.
    #[test]
    fn a_sample_of_another_session_is_refused_by_name() {
        let size = ModuleSize::METRE;
        let of = |session| Heartbeat::new([&heartbeat(1)], size).in_session(SessionId(session));
        assert_eq!(accepted(of(4), SessionId(4), size).unwrap().len(), 1);
        assert_eq!(
            accepted(of(3), SessionId(4), size),
            Err("it belongs to session 3, and this node to session 4".to_owned())
        );
    }

    /// Shows C6.
    #[test]
    fn a_verdict_counts_in_its_own_session_alone() {
        let of = |session, outcome| Verdict {
            session,
            outcome,
            ..Verdict::default()
        };
        let ours = SessionId(4);
        let complete = of(4, Verdict::OUTCOME_COMPLETE);
        assert_eq!(
            accepted_verdict(complete.clone(), ours),
            Ok(complete.clone())
        );
        assert_eq!(
            accepted_verdict(of(3, Verdict::OUTCOME_COMPLETE), ours),
            Err("it belongs to session 3, and this node to session 4".to_owned())
        );
        assert_eq!(
            accepted_verdict(of(4, 0), ours),
            Err(
                "verdict: outcome: 0 is unknown; known are COMPLETE 1, PARTIAL 2, FAILED 3, NOT_JUDGED 4"
                    .to_owned()
            )
        );
        let long = Verdict {
            violations: vec!["x".repeat(2_000)],
            ..complete
        };
        assert!(accepted_verdict(long, ours).is_err());
    }

    #[test]
    fn a_target_of_a_revision_that_none_can_follow_is_refused() {
        let of = |revision| TargetConfiguration {
            revision,
            withdrawn: true,
            ..TargetConfiguration::default()
        };
        let (own, size) = (SessionId(0), ModuleSize::METRE);
        assert!(accepted(of(stamp::revision()), own, size).is_ok());
        let refused = accepted(of(u64::MAX), own, size).unwrap_err();
        assert!(refused.contains("too far ahead of this clock"), "{refused}");
    }

    #[test]
    fn a_contradictory_sample_is_refused_whole() {
        let one = heartbeat(1);
        let size = ModuleSize::METRE;
        assert!(
            Heartbeat::new([&one, &one], size)
                .into_messages(size)
                .is_err()
        );
    }

    #[test]
    fn a_sample_of_another_size_is_refused_by_name_unless_it_is_of_another_session() {
        let size = |metres| ModuleSize::from_metres(metres).unwrap();
        let of = |metres| Heartbeat::new([&heartbeat(1)], size(metres));
        let ours = SessionId(0);
        assert!(accepted(of(0.08), ours, size(0.08)).is_ok());
        let expected = "heartbeats: module_size: is 1 m, but the modules of this node measure 0.08 m; give all nodes \
                        the same";
        assert_eq!(
            accepted(of(1.0), ours, size(0.08)),
            Err(expected.to_owned())
        );
        let states = ModuleStates::new(stamp::header("map"), Duration::ZERO, [], size(1.0));
        assert!(accepted(states.clone(), ours, size(0.08)).is_err());
        let other = states.in_session(SessionId(7));
        assert!(accepted(other, ours, size(0.08)).is_ok());
        let target = TargetConfiguration {
            withdrawn: true,
            ..TargetConfiguration::default()
        };
        assert!(
            accepted(target, ours, size(0.08)).is_ok(),
            "a withdrawal stops modules of any size"
        );
    }
}
