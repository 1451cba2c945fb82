//! Whether the machine's wall clock was set back since a process joined the graph.
//!
//! RustDDS gives best-effort samples to their reader by the time at which they came: those from the last one that was read
//! up to now. It stamps samples in ascending order, so after the clock was set back each new one lies ahead of now, and no
//! heartbeat is read until the clock is there again. Only a new participant begins with the clock as it is.

use std::cell::Cell;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// By how much the clock may be set back before a process joins the graph again, which costs it more than to wait.
const STEP_MAX: Duration = Duration::from_secs(5);

/// Compares the wall clock of this machine with one that is never set.
pub(crate) struct WallClockWatchdog {
    start: Instant,
    /// The most by which the wall clock was ahead of the time since the start.
    ahead: Cell<Duration>,
}

impl WallClockWatchdog {
    /// To be called before the participant is created.
    pub(crate) fn before_participant() -> Self {
        let watchdog = Self {
            start: Instant::now(),
            ahead: Cell::new(Duration::ZERO),
        };
        watchdog.set_back_by();
        watchdog
    }

    /// By how much the clock was set back, if that is more than a wait would cost.
    pub(crate) fn set_back_by(&self) -> Option<Duration> {
        let since_start = self.start.elapsed();
        let wall = SystemTime::now().duration_since(UNIX_EPOCH);
        let ahead = wall.unwrap_or_default().saturating_sub(since_start);
        self.step_to(ahead)
    }

    fn step_to(&self, ahead: Duration) -> Option<Duration> {
        let most = self.ahead.get().max(ahead);
        self.ahead.set(most);
        let step = most.saturating_sub(ahead);
        (step > STEP_MAX).then_some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_back_count_from_the_latest_time_that_the_clock_showed() {
        let watchdog = WallClockWatchdog {
            start: Instant::now(),
            ahead: Cell::new(Duration::from_secs(1_000)),
        };
        let step = |to: u64| watchdog.step_to(Duration::from_secs(to));
        assert_eq!(step(1_000), None);
        assert_eq!(step(996), None, "the wait is short");
        assert_eq!(step(4_600), None, "forward");
        assert_eq!(step(1_000), Some(Duration::from_secs(3_600)));
        assert_eq!(step(4_590), Some(Duration::from_secs(10)));
        assert_eq!(step(4_600), None, "it is there again");
    }

    #[test]
    fn a_clock_that_runs_on_is_not_set_back() {
        let watchdog = WallClockWatchdog::before_participant();
        assert!(watchdog.ahead.get() > Duration::ZERO);
        assert_eq!(watchdog.set_back_by(), None);
    }
}
