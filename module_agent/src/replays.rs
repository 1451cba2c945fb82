//! Recordings that are played next to the modules, which would command them.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::SourceId;

/// At most this many players are known; the samples of others are refused one by one.
const PLAYERS_MAX: usize = 64;

/// The participants that play recordings.
#[derive(Debug, Default)]
pub(crate) struct Replays(BTreeSet<SourceId>);

impl Replays {
    /// Ignores a sample that was sent this long after it was made, and from now on all of its participant; says so once.
    /// Enforces C7.
    pub(crate) fn ignore(&mut self, player: SourceId, topic: &str, after: Duration) {
        if self.0.len() < PLAYERS_MAX && self.0.insert(player) {
            tracing::warn!(
                topic,
                "ignores a participant that plays a recording: a sample of it was made {} s before it was sent. To form the \
                 recorded target, announce it with the target publisher",
                after.as_secs()
            );
        }
    }

    /// Whether this participant plays a recording.
    pub(crate) fn is_one(&self, participant: SourceId) -> bool {
        self.0.contains(&participant)
    }
}
