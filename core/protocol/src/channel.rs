//! Whether this module counts on receiving another one.

use std::time::Duration;

/// After this many failures the time for which a channel is down no longer doubles; it is the shorter for gaps, which end by themselves.
const DOUBLINGS_MAX: u32 = 4;
const GAP_DOUBLINGS_MAX: u32 = 2;

/// A channel that held for this many times the least time for which a failure takes it down is as good as one that never failed.
const MENDED_AFTER: u32 = 32;

/// The channel from another module. One that fails is down for a while, for twice as long with each failure that follows, so that one that
/// comes and goes ends fewer and fewer rosters.
#[derive(Clone, Copy, Debug, Default, Hash)]
pub(super) struct Channel {
    failures: u32,
    down_until: Duration,
}

impl Channel {
    /// Enforces M6.
    pub fn is_up(self, now: Duration) -> bool {
        self.down_until <= now
    }

    /// When it is up again.
    pub fn down_until(self) -> Duration {
        self.down_until
    }

    /// Nothing came for longer than `suspicion`, and now something does. The first gap, such as after a cut, takes the channel down for no
    /// longer, and later ones for less than a member without progress: the gap itself has kept it out.
    /// Enforces M6.
    pub fn note_gap(&mut self, last_seen: Duration, now: Duration, suspicion: Duration) {
        if self.failures == 0 || self.has_mended(last_seen, suspicion) {
            (self.failures, self.down_until) = (1, now);
        } else {
            self.failures = self.failures.min(GAP_DOUBLINGS_MAX);
            self.take_down(now, suspicion / 4);
        }
    }

    fn has_mended(self, last_seen: Duration, least: Duration) -> bool {
        last_seen > self.down_until + least * MENDED_AFTER
    }

    /// Its module made no progress.
    /// Enforces M6.
    pub fn fail(&mut self, now: Duration, least: Duration) {
        if self.is_up(now) && self.has_mended(now, least) {
            self.failures = 0;
        }
        self.take_down(now, least);
    }

    fn take_down(&mut self, now: Duration, least: Duration) {
        if self.is_up(now) {
            self.down_until = now + least * (1 << self.failures);
            self.failures = (self.failures + 1).min(DOUBLINGS_MAX);
        }
    }

    /// Its module shows the same plan as this one.
    pub fn recover(&mut self, now: Duration) {
        self.down_until = self.down_until.min(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shows M6.
    #[test]
    fn a_channel_that_fails_again_and_again_is_down_for_longer_and_longer() {
        let second = Duration::from_secs(1);
        let mut channel = Channel::default();
        let mut now = second * 100;
        let mut down = Vec::new();
        for _ in 0..6 {
            channel.fail(now, second);
            down.push((channel.down_until() - now).as_secs());
            now = channel.down_until() + second;
            assert!(channel.is_up(now));
        }
        assert_eq!(down, [1, 2, 4, 8, 16, 16]);
        now += second * 60;
        channel.fail(now, second);
        assert_eq!(channel.down_until(), now + second);
    }

    /// Shows M6.
    #[test]
    fn the_first_gap_takes_a_channel_down_for_no_longer() {
        let second = Duration::from_secs(1);
        let mut channel = Channel::default();
        let mut now = second * 100;
        for down in [0, 2, 4, 4] {
            channel.note_gap(now - second, now, second * 4);
            assert_eq!(channel.down_until(), now + second * down);
            now += second * 100;
        }
        now += second * 60;
        channel.note_gap(now - second, now, second * 4);
        assert!(channel.is_up(now));
    }
}
