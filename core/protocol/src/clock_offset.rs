//! How the clock of another process differs from this one's, as its heartbeats show it.

use std::time::Duration;

/// By how much two clocks may drift apart: one part in this many. Quartz is a hundred times better.
const DRIFT_DIVISOR: u32 = 1_000;

/// After this many periods between heartbeats the offset of a clock is taken for known.
const PERIODS_KNOWN: u32 = 4;

/// The first heartbeats come from a queue as long as they follow each other faster than a period by this factor.
const QUEUE_DIVISOR: u32 = 8;

/// Before that, the longer the gain, the shorter is the time in which it can be told from a queue of first heartbeats: their product, in
/// periods, exceeds this.
const PERIODS_PRODUCT: i128 = 10;

/// The start of another run by this module's clock, in signed microseconds, as its least delayed heartbeat shows it.
#[derive(Clone, Copy, Debug, Hash)]
pub(super) struct ClockOffset {
    start_us: i128,
    /// When the first heartbeat came, or the last of a queue that began with it; and when the latest came.
    first_heard_at: Duration,
    heard_at: Duration,
    /// The start as it was known when no heartbeat had come for a while, and until when that is compared with.
    before_us: i128,
    before_until: Duration,
    /// How much earlier heartbeats last came than those before, if that was more than the time between two, and when.
    gain: Option<(Duration, Duration)>,
}

/// A clock that may have stood still.
#[derive(Clone, Copy, Debug, Hash)]
pub(super) struct ClockDoubt {
    /// Since when.
    pub since: Duration,
    /// For how long it must have stood still to be late.
    pub limit: Duration,
}

fn micros(duration: Duration) -> i128 {
    i128::try_from(duration.as_micros()).map_or(i128::MAX / 4, |micros| micros.min(i128::MAX / 4))
}

impl ClockOffset {
    /// What is known with one more heartbeat; see [`Self::add`].
    pub fn with(known: Option<Self>, now: Duration, uptime: Duration, period: Duration) -> Self {
        match known {
            Some(mut clock) => {
                clock.add(now, uptime, period);
                clock
            }
            None => Self::first(now, uptime),
        }
    }

    /// What the first heartbeat of a run shows, which has this uptime.
    fn first(now: Duration, uptime: Duration) -> Self {
        let start_us = micros(now) - micros(uptime);
        Self {
            start_us,
            first_heard_at: now,
            heard_at: now,
            before_us: start_us,
            before_until: now,
            gain: None,
        }
    }

    /// Adds a heartbeat; those that come within half a `period` are compared with the same earlier ones.
    ///
    /// The least delayed heartbeat so far gives the offset between the clocks; it may creep, since clocks drift.
    fn add(&mut self, now: Duration, uptime: Duration, period: Duration) {
        let creep = micros(now.saturating_sub(self.heard_at) / DRIFT_DIVISOR);
        let expected = self.start_us + creep;
        if now >= self.before_until {
            (self.before_us, self.before_until) = (expected, now + period / 2);
        }
        self.start_us = expected.min(micros(now) - micros(uptime));
        let is_queued = now.saturating_sub(self.heard_at) < period / QUEUE_DIVISOR;
        if is_queued && self.heard_at == self.first_heard_at {
            self.first_heard_at = now;
        }
        self.heard_at = now;
        let gain = self.before_us - self.start_us;
        if gain > micros(period) && self.could_show(gain, now, period) {
            let gain = Duration::from_micros(u64::try_from(gain).unwrap_or(u64::MAX));
            self.gain = Some((now, gain));
        }
    }

    /// When a heartbeat with this uptime was sent. One that lay in a buffer while this process or the network stood still is
    /// recognised as old in this way.
    /// Enforces M1.
    pub fn sent_at(&self, uptime: Duration) -> Duration {
        let sent = (self.start_us + micros(uptime)).clamp(0, micros(self.heard_at));
        Duration::from_micros(u64::try_from(sent).unwrap_or(u64::MAX))
    }

    /// Whether heartbeats had come for a while before a time: the first ones may come late together, from a queue.
    fn is_known_at(&self, time: Duration, period: Duration) -> bool {
        self.first_heard_at + period * PERIODS_KNOWN <= time
    }

    /// Whether a gain of so many microseconds at a time could be told from a queue of first heartbeats.
    fn could_show(&self, gain_us: i128, time: Duration, period: Duration) -> bool {
        let known_for = micros(time.saturating_sub(self.first_heard_at));
        let period_us = micros(period);
        self.is_known_at(time, period)
            || known_for * gain_us > period_us * period_us * PERIODS_PRODUCT
    }

    /// Whether heartbeats that came since a time could show such a gain.
    pub fn is_compared_at(&self, time: Duration, gain: Duration, period: Duration) -> bool {
        self.heard_at >= time && self.could_show(micros(gain), time, period)
    }

    /// By how much heartbeats since a time came earlier than those before, if that was more than the time between two: for as long
    /// did this clock stand still, or was every message late.
    pub fn gain_since(&self, time: Duration) -> Duration {
        let gain = self.gain.filter(|&(at, _)| at >= time);
        gain.map_or(Duration::ZERO, |(_, gain)| gain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(500);

    fn at(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    #[test]
    fn a_clock_that_stood_still_shows_in_each_heartbeat_and_in_a_queue_of_them() {
        let mut one = ClockOffset::first(at(1_000), at(20));
        for beat in 1..6 {
            one.add(at(1_010 + 500 * beat), at(20 + 500 * beat), PERIOD);
        }
        let before = one;
        assert_eq!(one.gain_since(at(0)), Duration::ZERO, "10 ms are a delay");
        one.add(at(3_900), at(32_900), PERIOD);
        let gain = one.gain_since(at(3_900));
        assert!(gain > at(29_900) && gain < at(30_100), "{gain:?}");
        one.add(at(4_400), at(33_400), PERIOD);
        assert_eq!(one.gain_since(at(3_900)), gain, "it is known for a while");
        assert_eq!(one.gain_since(at(4_400)), Duration::ZERO);

        let mut queued = before;
        for sent in 6..66 {
            queued.add(at(3_900), at(20 + 500 * sent), PERIOD);
        }
        assert!(queued.gain_since(at(3_900)) > at(28_500));
    }

    /// A process that begins a new run after a suspension may be suspended again before it has heard the others for long.
    #[test]
    fn a_clock_that_stands_still_soon_after_the_first_heartbeat_shows_if_it_does_so_for_long() {
        let cases = [
            (120, 28_000, true),
            (120, 4_000, false),
            (1_200, 4_000, true),
            (1_200, 1_000, false),
        ];
        for (known_for, slept_for, is_found) in cases {
            let (first, later) = (at(1_000), at(1_000 + known_for));
            let mut one = ClockOffset::first(first, at(20));
            one.add(later, at(20 + known_for + slept_for), PERIOD);
            let gain = one.gain_since(later);
            assert_eq!(gain >= at(slept_for), is_found, "{gain:?}");
            assert_eq!(one.is_compared_at(later, at(slept_for), PERIOD), is_found);
        }
    }

    /// A process that was stopped may hear another one for the first time by many of its heartbeats at once.
    #[test]
    fn a_queue_of_the_first_heartbeats_is_no_gain() {
        let mut one = ClockOffset::first(at(9_000), at(20));
        for sent in 1..40 {
            one.add(at(9_000), at(20 + 500 * sent), PERIOD);
        }
        assert_eq!(one.gain_since(at(0)), Duration::ZERO);
        // Slowly, as the machine is busy.
        let mut one = ClockOffset::first(at(9_000), at(20));
        for sent in 1..60 {
            one.add(at(9_000 + 10 * sent), at(20 + 500 * sent), PERIOD);
        }
        assert_eq!(one.gain_since(at(0)), Duration::ZERO);
    }

    #[test]
    fn a_link_that_becomes_four_seconds_slower_makes_all_heartbeats_four_seconds_old() {
        let mut one = ClockOffset::first(at(1_000), at(0));
        for beat in 1..1_000 {
            let now = at(5_000 + 500 * beat);
            one.add(now, at(500 * beat), PERIOD);
            let age = now - one.sent_at(at(500 * beat));
            // Clocks may drift by a thousandth.
            let crept = at(beat / 2 + 4);
            assert!(age > at(3_999) - crept, "{beat}: {age:?}");
        }
    }

    #[test]
    fn drift_and_a_peer_that_falls_behind_are_no_gain() {
        let mut one = ClockOffset::first(at(1_000), at(0));
        for beat in 1..10_000 {
            one.add(at(1_000 + 500 * beat), at(500 * beat + beat / 4), PERIOD);
        }
        assert_eq!(one.gain_since(at(0)), Duration::ZERO);
        one.add(at(5_060_000), at(5_002_000), PERIOD);
        assert_eq!(one.gain_since(at(0)), Duration::ZERO);
    }
}
