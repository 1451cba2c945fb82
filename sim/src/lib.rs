//! Many agents in one process, under virtual time and a seeded network.
//!
//! The agents are the same as under DDS; only the transport of their messages differs. A seed replays a run exactly, so a
//! failure can be reproduced from one number.

mod campaign;
mod cluster;
mod faults;
mod monitor;
mod network;
mod observation;
mod obstacles;
mod process;
mod sweep;
mod transcript;
mod verifier;

pub use campaign::{CampaignError, CampaignParameters, Ending, SeedReport, run_seed};
pub use cluster::{Cluster, ClusterParameters, Standing, Stores};
pub use faults::{CarryMoment, Fault, FaultKind, ScheduledFault};
pub use monitor::{BrokenInvariant, ViolationKind, blocks_all, room};
pub use network::NetworkParameters;
pub use observation::Observation;
pub use process::{AgentFactory, Way};
pub use sweep::run_seeds;
pub use transcript::{Transcript, TranscriptLine};
