//! The clock of all measurements.

use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// The processor time of this thread, which does not depend on the load of the machine.
pub fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(
        time.tv_sec.unsigned_abs(),
        u32::try_from(time.tv_nsec).unwrap_or_default(),
    )
}
