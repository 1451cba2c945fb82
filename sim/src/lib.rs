//! Many agents in one process, under virtual time and a seeded network.
//!
//! The agents are those that run under DDS; only what carries their messages differs. One seed replays one run exactly,
//! so a failure is a number that anyone can look at again.

mod campaign;
mod cluster;
mod ending;
mod faults;
mod invariants;
mod network;
mod process;
mod sweep;
mod transcript;

pub use campaign::{CampaignError, CampaignParameters, Ending, RunReport, run_seed};
pub use cluster::{Cluster, ClusterParameters, Observation, Standing};
pub use faults::{Fault, FaultKind, Strike};
pub use invariants::{Violation, ViolationKind};
pub use network::NetworkParameters;
pub use process::AgentFactory;
pub use sweep::run_seeds;
pub use transcript::{Transcript, TranscriptLine};
