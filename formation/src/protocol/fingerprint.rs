//! What an agent will do next, as one number: for searches that must notice when two histories lead to the same state.

use std::fmt::{self, Write as _};
use std::hash::{DefaultHasher, Hasher as _};

use super::acting::Acting;
use super::turns::Turns;
use super::{Agent, Stage};

/// Hashes what is written to it, without keeping it.
struct HashingWriter(DefaultHasher);

impl fmt::Write for HashingWriter {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

impl Agent {
    /// A hash of everything that its behaviour depends on; counts for reports are left out. Two agents of one module with
    /// equal fingerprints do the same from now on, up to collisions of 64-bit hashes.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let mut writer = HashingWriter(DefaultHasher::new());
        // Writing to a hasher cannot fail.
        let _ = write!(
            writer,
            "{:?}{:?}{:?}{:?}{:?}{:?}{:?}{:?}{:?}{:?}{:?}",
            self.incarnation,
            self.body,
            self.service,
            self.peers,
            (
                self.announcement.as_ref().map(|known| known.revision),
                &self.targets
            ),
            self.epoch,
            self.quorum,
            self.convening,
            self.early_claims,
            self.voice,
            (
                self.standing_back_until,
                self.duplicate_told,
                self.succeeded_by,
                self.wake
            ),
        );
        let _ = match &self.stage {
            Stage::Idle => write!(writer, "idle"),
            Stage::Gathering(gathering) => write!(writer, "{gathering:?}"),
            Stage::Planning(turns) => write!(writer, "{turns:?}"),
            Stage::Acting(acting) => write!(writer, "{acting:?}"),
            Stage::Outsider(roster) => write!(writer, "outsider {}", roster.epoch),
        };
        writer.0.finish()
    }
}

// The roster and what was decided on it follow from the epoch and the number of turns; in an acting phase from the digest.

impl fmt::Debug for Turns {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} {} {:?}",
            self.roster().epoch,
            self.applied(),
            self.progress_at()
        )
    }
}

impl fmt::Debug for Acting {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?} {:?}", self.digest(), self.progress())
    }
}
