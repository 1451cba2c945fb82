//! How long planning takes, where there is a clock.

#[cfg(not(target_family = "wasm"))]
use std::time::Instant;

/// Measures from its start on.
#[derive(Clone, Copy)]
pub(crate) struct Stopwatch {
    #[cfg(not(target_family = "wasm"))]
    start: Instant,
}

impl Stopwatch {
    /// Starts.
    pub fn start() -> Self {
        Self {
            #[cfg(not(target_family = "wasm"))]
            start: Instant::now(),
        }
    }

    /// The microseconds since the start.
    #[cfg(not(target_family = "wasm"))]
    pub fn passed_us(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    /// 0, as WebAssembly in a browser has no clock for the standard library.
    #[cfg(target_family = "wasm")]
    pub fn passed_us(&self) -> u64 {
        0
    }
}
