//! Violations that were found in an end state, and when they are reported.

use std::time::Duration;

use super::parameters::ObserverParameters;

/// The time in which a process that continues publishes what it lacks.
const ONE_REACTION: Duration = Duration::from_secs(1);

/// Violations wait at most so many times as long as while all members are heard.
const WAITS_MAX: u32 = 4;

/// Violations that were found without a break.
#[derive(Clone, Copy, Debug)]
pub(super) struct Breach {
    since: Duration,
    /// Since when all members have been heard.
    heard_since: Duration,
}

impl Breach {
    pub(super) fn found_at(now: Duration) -> Self {
        Self {
            since: now,
            heard_since: now,
        }
    }

    /// Begins the wait anew, as not all members are heard: what is broken may be mended.
    pub(super) fn unheard_at(self, now: Duration) -> Self {
        Self {
            heard_since: now,
            ..self
        }
    }

    /// When it is reported. A member that is stopped for less than the silence that is granted to it, such as one that has yet to follow a
    /// link, can continue until then.
    pub(super) fn reported_at(self, parameters: &ObserverParameters) -> Duration {
        let silence = parameters.silence.saturating_add(ONE_REACTION);
        let wait = silence.min(parameters.time_limit).max(parameters.grace);
        let longest = wait.saturating_mul(WAITS_MAX);
        let heard_long = self.heard_since.saturating_add(wait);
        heard_long.min(self.since.saturating_add(longest))
    }
}
