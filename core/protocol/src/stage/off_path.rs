//! A module that is measured off what its plan lets it do.

use std::time::Duration;

use formation_model::{MicroUnits, Pose};

/// How long a module must be measured at one place off its way before it counts as displaced. Localisation that jumps and returns
/// sooner displaces nobody.
const STOOD: Duration = Duration::from_secs(2);

/// A module that is measured off its way.
#[derive(Clone, Copy, Debug, Hash)]
pub(super) struct OffPath {
    /// How far off it was last measured.
    pub distance: MicroUnits,
    /// Where it was measured at `since`; near that ever since.
    pose: Pose,
    since: Duration,
    /// Whether its drive is at rest, as far as that is known.
    pub stands: bool,
    /// Whether it is believed to be there; otherwise its localisation is lost.
    pub is_believed: bool,
}

impl OffPath {
    /// What is known when the module is measured again, off by this distance.
    pub fn next(
        known: Option<Self>,
        (pose, distance, stands): (Pose, MicroUnits, bool),
        limit: MicroUnits,
        now: Duration,
    ) -> Self {
        let stays = |known: &Self| known.pose.distance_to(&pose) <= limit;
        let known = known.filter(stays);
        Self {
            distance,
            pose: known.map_or(pose, |known| known.pose),
            since: known.map_or(now, |known| known.since),
            stands,
            is_believed: true,
        }
    }

    /// When it counts as displaced if it stays where it is.
    pub fn counts_at(&self) -> Duration {
        self.since + STOOD
    }
}
