//! The event log of a run, kept for its report.

use formation_event_log::{Entry, LogEvent};
use formation_model::{Digest, Epoch, ModuleId};

/// The most entries that are kept: some hundred megabytes, and far more than a run of 100 modules has.
const ENTRIES_MAX: usize = 200_000;
/// Poses, which are the most frequent and the least important entries, are kept while there are fewer entries than this.
const ENTRIES_WITH_POSES_MAX: usize = 100_000;

/// The entries of a run, in the order in which they came.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    entries: Vec<Entry>,
    left_out: usize,
}

/// The roster of an epoch, as far as the event log shows it.
#[derive(Clone, Copy, Debug)]
pub struct SeenRoster<'a> {
    /// Its members.
    pub modules: &'a [ModuleId],
    /// Those of them that take no spot.
    pub out_of_service: &'a [ModuleId],
    /// The digest of the problem for which they plan.
    pub problem: Option<Digest>,
}

impl Recording {
    /// Keeps an entry if there is room.
    pub fn keep(&mut self, entry: Entry) {
        let most = match entry.event {
            LogEvent::Pose { .. } => ENTRIES_WITH_POSES_MAX,
            _ => ENTRIES_MAX,
        };
        if self.entries.len() < most {
            self.entries.push(entry);
        } else {
            self.left_out += 1;
        }
    }

    /// The entries.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The roster of an epoch.
    pub fn roster(&self, wanted: Epoch) -> Option<SeenRoster<'_>> {
        self.entries
            .iter()
            .rev()
            .find_map(|entry| match &entry.event {
                LogEvent::Roster {
                    epoch,
                    modules,
                    out_of_service,
                    problem,
                } if *epoch == wanted => Some(SeenRoster {
                    modules,
                    out_of_service,
                    problem: *problem,
                }),
                _ => None,
            })
    }

    /// That there was no room for some entries, if so.
    pub fn note(&self) -> Option<String> {
        let left_out = self.left_out;
        (left_out > 0).then(|| {
            format!("{left_out} entries were left out of the film, as there were too many")
        })
    }
}

#[cfg(test)]
mod tests {
    use formation_model::Pose;

    use super::*;

    #[test]
    fn a_recording_is_bounded_and_keeps_what_matters() {
        let entry = |event| Entry { at_ms: 1, event };
        let pose = entry(LogEvent::Pose {
            module: ModuleId(1),
            pose: Pose::default(),
        });
        let epoch = entry(LogEvent::Gathering(Epoch {
            number: 1,
            convener: ModuleId(1),
        }));
        let mut recording = Recording::default();
        for _ in 0..ENTRIES_WITH_POSES_MAX + 5 {
            recording.keep(pose.clone());
        }
        assert_eq!(recording.entries().len(), ENTRIES_WITH_POSES_MAX);
        assert_eq!(recording.left_out, 5);
        for _ in 0..ENTRIES_MAX {
            recording.keep(epoch.clone());
        }
        assert_eq!(recording.entries().len(), ENTRIES_MAX);
        assert_eq!(recording.left_out, 5 + ENTRIES_WITH_POSES_MAX);
    }
}
