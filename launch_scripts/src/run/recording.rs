//! What the verifier heard, kept for the report.

use std::collections::BTreeMap;

use formation::event_log::{Entry, Event};
use formation::model::{ModuleId, ModulePhase, SpotId};
use formation_report::{Ending, Fact, Subject, Summary, Tone};

use crate::arguments::RunArguments;
use crate::failure::one_line;
use crate::plan::CheckedPlan;
use crate::report;

use super::report::RunReport;

/// So many entries are kept: some hundred megabytes at the most, and far more than a run of 100 modules makes.
const ENTRIES_MAX: usize = 200_000;
/// Poses, of which there are most and which say least, are kept while there are fewer entries than this.
const ENTRIES_WITH_POSES_MAX: usize = 100_000;

/// The entries of a run, in the order in which they came.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    entries: Vec<Entry>,
    left_out: usize,
}

impl Recording {
    /// Keeps an entry if there is room.
    pub fn keep(&mut self, entry: Entry) {
        let most = match entry.event {
            Event::Pose { .. } => ENTRIES_WITH_POSES_MAX,
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

    /// What the pictures of a run show: who ended where, by the verdict where there is one.
    pub fn subject(&self, plan: &CheckedPlan, name: &str, report: Option<&RunReport>) -> Subject {
        let name = one_line(name);
        if report.is_some_and(RunReport::nothing_moved) {
            return Subject::planned(&name, &plan.problem, &plan.outcome);
        }
        let mut endings = self.endings();
        if let Some(report) = report {
            let judged: BTreeMap<ModuleId, SpotId> = report.assignments().collect();
            for (module, ending) in &mut endings {
                ending.spot = judged.get(module).copied();
            }
        }
        Subject::seen(&name, &plan.problem, &plan.outcome, &endings)
    }

    /// What each module told last.
    fn endings(&self) -> BTreeMap<ModuleId, Ending> {
        let mut endings: BTreeMap<ModuleId, Ending> = BTreeMap::new();
        for entry in &self.entries {
            match &entry.event {
                Event::State(told) => {
                    let is_settled = told.phase == ModulePhase::Settled;
                    endings.insert(
                        told.module,
                        Ending {
                            pose: told.pose,
                            spot: told.spot.filter(|_| is_settled),
                            links: told.links.clone(),
                        },
                    );
                }
                Event::Pose { module, pose } => {
                    if let Some(ending) = endings.get_mut(module) {
                        ending.pose = *pose;
                    }
                }
                Event::Gathering(_) | Event::Roster { .. } | Event::Claim { .. } => {}
            }
        }
        endings
    }

    /// What the page of a run says besides the film; `failure` is why there is no verdict.
    pub fn summary(
        &self,
        plan: &CheckedPlan,
        arguments: &RunArguments,
        report: Option<&RunReport>,
        failure: Option<&str>,
    ) -> Summary {
        let mut facts = report.map(RunReport::facts).unwrap_or_default();
        facts.extend(report::facts(plan));
        facts.push(Fact::new(
            "speed of simulated modules",
            format!("{} units a second", arguments.speed),
        ));
        let mut notes = plan.statistics.warnings.clone();
        notes.extend(report.into_iter().flat_map(RunReport::reproaches));
        if self.left_out > 0 {
            notes.push(format!(
                "{} entries were left out of the film, as there were too many",
                self.left_out
            ));
        }
        Summary {
            outcome: report
                .map(RunReport::outcome_text)
                .or_else(|| failure.map(|failure| format!("Broken off: {failure}")))
                .unwrap_or_default(),
            tone: match report {
                Some(report) if report.conclusion().is_err() => Tone::Bad,
                Some(report) if report.nothing_moved() => Tone::Neutral,
                Some(_) => Tone::Good,
                None => Tone::Bad,
            },
            source: "Recorded from the topics of the running processes. The film stretches turns, which take \
                     milliseconds, and cuts waits; the clock beside it counts seconds since the verifier began to listen."
                .to_owned(),
            facts,
            notes,
        }
    }
}

#[cfg(test)]
mod tests {
    use formation::model::{Epoch, Pose};

    use super::*;

    fn entry(event: Event) -> Entry {
        Entry { at_ms: 1, event }
    }

    #[test]
    fn whatever_comes_a_recording_stays_bounded_and_keeps_what_matters() {
        let pose = entry(Event::Pose {
            module: ModuleId(1),
            pose: Pose::default(),
        });
        let epoch = entry(Event::Gathering(Epoch {
            number: 1,
            convener: ModuleId(1),
        }));
        let mut recording = Recording::default();
        for _ in 0..ENTRIES_WITH_POSES_MAX + 5 {
            recording.keep(pose.clone());
        }
        assert_eq!(recording.entries.len(), ENTRIES_WITH_POSES_MAX);
        assert_eq!(recording.left_out, 5);
        for _ in 0..ENTRIES_MAX {
            recording.keep(epoch.clone());
        }
        assert_eq!(recording.entries.len(), ENTRIES_MAX);
        assert_eq!(recording.left_out, 5 + ENTRIES_WITH_POSES_MAX);
    }
}
