//! What is measured of one instance.

pub(crate) mod auction;
pub(crate) mod matching;
pub(crate) mod plan;
pub(crate) mod processes;
pub(crate) mod protocol;
mod spot_table;

use std::time::{Duration, Instant};

/// How long `work` takes, in microseconds: the median of `times` runs after one that warms up.
pub(crate) fn median_us(times: u32, mut work: impl FnMut()) -> f64 {
    work();
    let mut elapsed: Vec<Duration> = (0..times.max(1))
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed()
        })
        .collect();
    elapsed.sort_unstable();
    elapsed[elapsed.len() / 2].as_secs_f64() * 1e6
}
