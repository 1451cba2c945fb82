//! Taking in what others publish.

use futures::StreamExt;
use futures::stream::LocalBoxStream;
use ros2_client::Subscription;
use serde::de::DeserializeOwned;

use crate::session::{ParticipantId, Session, SessionError, source_of};
use crate::topic::Topic;

/// A subscription and the name under which its samples are counted.
pub struct Inlet<M> {
    topic: &'static str,
    subscription: Subscription<M>,
}

impl<M: DeserializeOwned + 'static> Inlet<M> {
    /// Subscribes a topic.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn open(session: &mut Session, topic: &Topic<M>) -> Result<Self, SessionError> {
        Ok(Self {
            topic: topic.name(),
            subscription: session.subscription(topic)?,
        })
    }

    /// The name under which its samples are counted.
    #[must_use]
    pub fn topic(&self) -> &'static str {
        self.topic
    }

    /// Every sample with its sender, or why it does not decode, for ever.
    pub fn samples(&self) -> LocalBoxStream<'_, Result<(ParticipantId, M), String>> {
        self.subscription
            .async_stream()
            .map(|taken| match taken {
                Ok((sample, info)) => Ok((source_of(&info), sample)),
                Err(error) => Err(error.to_string()),
            })
            .boxed_local()
    }
}
