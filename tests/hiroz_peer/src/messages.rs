//! The types of the messages, as hiroz generates them from the interface files, and the quality of service of topics.

use std::num::NonZeroUsize;

use hiroz::prelude::{QosDurability, QosHistory, QosProfile, QosReliability};

/// What hiroz generates, which this crate does not lint.
#[allow(
    clippy::all,
    clippy::unwrap_used,
    clippy::expect_used,
    dead_code,
    missing_docs,
    unexpected_cfgs,
    unused_qualifications,
    reason = "generated code"
)]
mod generated {
    include!(concat!(env!("OUT_DIR"), "/generated.rs"));
}
pub use generated::ros;

include!(concat!(env!("OUT_DIR"), "/corrected.rs"));

/// No sample is lost for lack of room while the peer is busy.
const DEPTH: NonZeroUsize = match NonZeroUsize::new(1_000) {
    Some(depth) => depth,
    None => NonZeroUsize::MIN,
};

/// The default of ROS 2.
pub fn volatile() -> QosProfile {
    QosProfile {
        history: QosHistory::KeepLast(DEPTH),
        ..QosProfile::default()
    }
}

/// Late subscribers get earlier samples.
pub fn latched() -> QosProfile {
    QosProfile {
        durability: QosDurability::TransientLocal,
        ..volatile()
    }
}

pub fn best_effort() -> QosProfile {
    QosProfile {
        reliability: QosReliability::BestEffort,
        ..volatile()
    }
}
