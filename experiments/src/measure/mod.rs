//! What is measured of one instance.

pub(crate) mod auction;
pub(crate) mod matching;
pub(crate) mod plan;
pub(crate) mod processes;
pub(crate) mod protocol;
mod spot_table;

use std::time::Instant;

/// How long `work` takes, in microseconds: the least of `times` runs after one that warms up.
///
/// The least, as other programs on the machine can only lengthen a run, and long ones more than short ones.
pub(crate) fn least_us(times: u32, mut work: impl FnMut()) -> f64 {
    work();
    let elapsed = (0..times.max(1)).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed()
    });
    elapsed.min().unwrap_or_default().as_secs_f64() * 1e6
}
