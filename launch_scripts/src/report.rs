//! What `--report` writes: pictures before and after, a page that plays what happened, and the numbers as JSON.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use formation::event_log::Entry;
use formation_report::{Fact, Subject, Summary, Tone, after, before, course_of_plan, page};
use serde::Serialize;

use crate::arguments::SPEED_UNITS_PER_S;
use crate::failure::{Failure, one_line};
use crate::plan::CheckedPlan;

/// The directory into which a report is written.
pub struct ReportDirectory {
    path: PathBuf,
}

impl ReportDirectory {
    /// Creates the directory where it does not exist.
    ///
    /// # Errors
    /// Says why it cannot be created.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot be created", path.display()))
            .map_err(Failure::BadInput)?;
        Ok(Self {
            path: path.to_owned(),
        })
    }

    /// Writes the report of a plan that was not carried out.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write_plan(&self, plan: &CheckedPlan, name: &str) -> Result<(), Failure> {
        let subject = Subject::planned(&one_line(name), &plan.problem, &plan.outcome);
        let course = course_of_plan(&plan.problem, &plan.outcome, SPEED_UNITS_PER_S);
        let statistics = &plan.statistics;
        let summary = Summary {
            outcome: format!(
                "Planned: {} of {} spots get a module",
                statistics.assignments.len(),
                plan.problem.target().spots().len()
            ),
            tone: Tone::Neutral,
            source: format!(
                "Planned offline and not carried out: the turns of the plan, then its motions as drives that go straight at \
                 {SPEED_UNITS_PER_S} units a second would make them. The clock beside the film counts the motions alone."
            ),
            facts: facts(plan),
            notes: statistics.warnings.clone(),
        };
        self.write_json(&plan.report())?;
        self.write_pictures(&subject, &course, &summary)
    }

    /// Writes the object that `--json` prints.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write_json(&self, report: &impl Serialize) -> Result<(), Failure> {
        let json = serde_json::to_string(report)
            .map_err(|error| Failure::Failed(anyhow!(error).context("cannot write the report")))?;
        self.write("report.json", &format!("{json}\n"))
    }

    /// Writes the pictures and the page.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write_pictures(
        &self,
        subject: &Subject,
        course: &[Entry],
        summary: &Summary,
    ) -> Result<(), Failure> {
        self.write("before.svg", &before(subject))?;
        self.write("after.svg", &after(subject))?;
        self.write("report.html", &page(subject, course, summary))
    }

    fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.path.join(name);
        fs::write(&path, text)
            .with_context(|| format!("{}: cannot be written", path.display()))
            .map_err(Failure::Failed)
    }
}

/// The numbers of a plan.
pub fn facts(plan: &CheckedPlan) -> Vec<Fact> {
    let statistics = &plan.statistics;
    let messages = &statistics.messages;
    vec![
        Fact::new("modules", plan.problem.modules().len()),
        Fact::new("modules without a spot", statistics.unassigned.len()),
        Fact::new("spots", plan.problem.target().spots().len()),
        Fact::new("spots left open", statistics.open_spots.len()),
        Fact::new("turns", plan.outcome.decisions.len()),
        Fact::new("evictions", statistics.evictions),
        Fact::new("links kept", statistics.kept_links),
        Fact::new("links broken", statistics.broken_links),
        Fact::new("modules detached", statistics.detached_modules),
        Fact::new("port changes", statistics.port_changes),
        Fact::new("total utility", format!("{:.3}", statistics.total_utility)),
        Fact::new(
            "total distance",
            format!("{:.3} units", statistics.total_distance),
        ),
        Fact::new("planned offline in", format!("{} µs", plan.planning_us)),
        Fact::new(
            "messages while planning",
            format!(
                "{} samples, {} deliveries, {} pairs delivered",
                messages.samples, messages.deliveries, messages.pairs
            ),
        ),
    ]
}
