//! Faults of real processes: some are killed, restarted or stopped for a while, networks are cut, and a peer sends false messages.
//!
//! `docs/fault_model.md` says which promise each of these tests shows.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

mod bodies;
mod hostile;
mod kills;
mod launcher;
mod partition;
mod removals;
mod restarts;
mod stop;
mod stores;

use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(90);

/// Five spots and ten modules, so that five may die; modules 1, 2 and 3 are docked and led by 2.
const SPARES: &str = "
name: spares
target:
  spots:
    - {id: 1, x: 5, y: 5}
    - {id: 2, x: 6, y: 5}
    - {id: 3, x: 7, y: 5}
    - {id: 4, x: 6, y: 6}
    - {id: 5, x: 6, y: 4}
  edges: [[1, 2], [2, 3], [2, 4], [2, 5]]
configurations:
  - id: 1
    leader: 2
    modules: [{id: 1, x: 1, y: 1}, {id: 2, x: 2, y: 1}, {id: 3, x: 3, y: 1}]
    edges: [[1, 2], [2, 3]]
singletons:
  - {id: 4, x: 9, y: 2}
  - {id: 5, x: 2, y: 9, theta: 1.0}
  - {id: 6, x: 9, y: 9}
  - {id: 7, x: 6, y: 1}
  - {id: 8, x: 4, y: 3}
  - {id: 9, x: 1, y: 6}
  - {id: 10, x: 9, y: 6}
";
