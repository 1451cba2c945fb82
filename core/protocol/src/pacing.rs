//! How long a module waits before it opens an epoch.

use std::time::Duration;

/// The times between epochs.
#[derive(Clone, Debug, Hash)]
pub(super) struct EpochPacing {
    /// No epoch is opened before this time, unless all expected modules are known earlier.
    listening_until: Duration,
    /// Since when there has been a reason for a new epoch.
    reason_since: Option<Duration>,
    /// When any module last opened an epoch.
    last_opened: Option<Duration>,
    /// The least time between epochs at present.
    interval: Duration,
}

impl EpochPacing {
    pub fn new(listening_until: Duration, interval: Duration) -> Self {
        Self {
            listening_until,
            reason_since: None,
            last_opened: None,
            interval,
        }
    }

    /// An epoch was agreed on: the next one waits for the least interval only.
    /// Enforces E5.
    pub fn relax(&mut self, interval: Duration) {
        self.interval = interval;
    }

    /// An epoch was opened: the interval doubles with each, up to `limit`.
    /// Enforces E5.
    pub fn opened(&mut self, now: Duration, limit: Duration) {
        if self.last_opened.is_some() {
            self.interval = (self.interval * 2).min(limit);
        }
        self.last_opened = Some(now);
        self.reason_since = None;
    }

    /// There is no reason for a new epoch.
    pub fn clear_reason(&mut self) {
        self.reason_since = None;
    }

    /// No other module remains whose first heartbeat has to be awaited.
    pub fn end_listening(&mut self, now: Duration) {
        self.listening_until = self.listening_until.min(now);
    }

    /// When an epoch may be opened for a reason that exists now, after a delay that depends on the module's rank.
    pub fn due(&mut self, now: Duration, delay: Duration) -> Duration {
        let since = *self.reason_since.get_or_insert(now);
        let next = self.last_opened.map(|last| last + self.interval);
        let earliest = since.max(self.listening_until);
        next.map_or(earliest, |next| earliest.max(next))
            .saturating_add(delay)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shows E5.
    #[test]
    fn the_interval_doubles_up_to_its_limit_until_an_epoch_agrees() {
        let (least, limit) = (Duration::from_secs(1), Duration::from_secs(16));
        let mut pacing = EpochPacing::new(Duration::ZERO, least);
        let mut intervals = Vec::new();
        for opened in 0..7 {
            pacing.opened(Duration::from_secs(100 * opened), limit);
            intervals.push(pacing.interval.as_secs());
        }
        assert_eq!(intervals, [1, 2, 4, 8, 16, 16, 16]);
        pacing.relax(least);
        assert_eq!(pacing.interval, least);
    }
}
