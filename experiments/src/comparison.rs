//! Ours against the paper policy on the same instances, with a reason wherever ours is behind.

use std::cmp::Ordering;

use crate::case_studies::CASES;
use crate::contender::PAPER_AND_OURS;
use crate::figures::{Data, Family, Group, Value, labelled, lattice, mixed, singletons, surplus};
use crate::instance::Instance;
use crate::measure::plan::PlanMeasurement;
use crate::sample::{exact, short};
use crate::settings::Settings;
use crate::table::Table;

/// The instances of one row.
struct Row {
    name: String,
    /// The groups of the paper policy and of ours.
    groups: [Group; 2],
}

/// One number by which both are compared.
struct Metric {
    name: &'static str,
    key: &'static str,
    paper: Of,
    ours: Of,
    higher_is_better: bool,
    /// Why ours can be behind, apart from spots that the paper policy leaves empty.
    reason: &'static str,
}

type Of = fn(&PlanMeasurement) -> f64;

impl Metric {
    /// A number with the same definition for both, of which less is better.
    const fn same(name: &'static str, key: &'static str, value: Of, reason: &'static str) -> Self {
        Self {
            name,
            key,
            paper: value,
            ours: value,
            higher_is_better: false,
            reason,
        }
    }
}

const NOTICES: &str = "each eviction publishes one notice, which changes no decision; optimal chains make more \
             evictions than the paper policy, which has no notices";
const PIECES: &str = "each piece of two or more modules that breaks off takes a turn of its own before its modules \
             are placed one by one";

const METRICS: [Metric; 9] = [
    Metric::same(
        "planning, ms",
        "planning_ms",
        |plan| plan.planning_us / 1e3,
        "the search for the best chain of evictions costs more than the paper's test of two modules",
    ),
    Metric {
        higher_is_better: true,
        ..Metric::same(
            "utility",
            "utility",
            |plan| plan.utility,
            "a configuration first maximises the number of modules that stay together, then utility; the \
             paper policy breaks more links, and single modules find nearer spots",
        )
    },
    Metric::same(
        "distance, units",
        "distance_units",
        |plan| plan.distance,
        "modules that stay together move to where they fit together; the paper policy breaks more links, \
             and single modules find nearer spots",
    ),
    Metric::same(
        "broken links",
        "broken_links",
        |plan| plan.broken_links as f64,
        "units decide one after another, and a larger fit of an earlier unit can cost a later unit more \
             links",
    ),
    Metric::same(
        "decisions",
        "decisions",
        |plan| plan.broadcasts as f64,
        PIECES,
    ),
    Metric {
        name: "decisions and notices",
        key: "samples",
        paper: |plan| plan.broadcasts as f64,
        ours: |plan| (plan.claims + plan.evictions) as f64,
        higher_is_better: false,
        reason: NOTICES,
    },
    Metric {
        name: "pairs delivered",
        key: "pairs_delivered",
        paper: |plan| plan.whole_set_pairs() as f64,
        ours: |plan| plan.pairs_delivered as f64,
        higher_is_better: false,
        reason: "claims list every spot whose module changes in a chain",
    },
    Metric::same(
        "samples, both by our protocol",
        "samples_same_protocol",
        |plan| (plan.claims + plan.evictions) as f64,
        "optimal chains make more evictions, and pieces take turns of their own; our protocol publishes \
             the whole decision of a configuration of the paper policy in one claim",
    ),
    Metric::same(
        "pairs delivered, both by our protocol",
        "pairs_same_protocol",
        |plan| plan.pairs_delivered as f64,
        "claims list every spot whose module changes in a chain",
    ),
];

/// The comparison of all instances.
pub(crate) struct Comparison {
    pub table: Table,
    /// How many numbers are compared, and in how many of them ours is ahead or equal.
    pub all: usize,
    pub ahead: usize,
    /// The table that the summary shows, with its footnotes.
    pub results: String,
}

/// Compares all instances that both have planned; `None` if there are none.
pub(crate) fn compare(data: &Data<'_>) -> Option<Comparison> {
    let rows = rows(data.settings);
    let rows: Vec<Compared> = rows.iter().filter_map(|row| row.compare(data)).collect();
    if rows.is_empty() {
        return None;
    }
    let mut table = Table::new(
        "instances | runs | metric | paper_policy_mean | ours_mean | ours_is | \
        paper_policy_filled_spots_mean | ours_filled_spots_mean | \
        paper_policy_per_filled_spot | ours_per_filled_spot | reason",
    );
    let mut heads = vec!["instances | spots filled"];
    heads.extend(METRICS.iter().map(|metric| metric.name));
    heads.push("where ours is not ahead");
    let mut summary = Table::new(&heads.join(" | "));
    let mut footnotes: Vec<String> = Vec::new();
    for row in &rows {
        row.tabulate(&mut table);
        summary.row(row.summarise(&mut footnotes));
    }
    let compared = rows.iter().flat_map(|row| &row.means);
    let ahead = compared
        .clone()
        .filter(|(metric, means)| metric.standing(*means).is_ge());
    let mut results = format!("{}\n", summary.to_markdown());
    for (number, footnote) in footnotes.iter().enumerate() {
        results.push_str(&format!("- {} {footnote}\n", letter(number)));
    }
    Some(Comparison {
        table,
        all: compared.count(),
        ahead: ahead.count(),
        results,
    })
}

/// A row with its means, those of the paper policy first.
struct Compared<'a> {
    name: &'a str,
    runs: usize,
    filled: [f64; 2],
    means: Vec<(&'static Metric, [f64; 2])>,
}

impl Row {
    /// `None` unless both have planned the same number of instances.
    fn compare(&self, data: &Data<'_>) -> Option<Compared<'_>> {
        let [of_paper, of_ours] = &self.groups;
        let sample = |group, value| data.sample(group, Value::Plan(value));
        let filled = self
            .groups
            .each_ref()
            .map(|group| sample(group, |plan| plan.filled_spots as f64));
        let [paper_runs, runs] = filled.map(|filled| filled.count);
        let means = |metric: &'static Metric| {
            let paper = sample(of_paper, metric.paper).mean;
            (metric, [paper, sample(of_ours, metric.ours).mean])
        };
        (runs > 0 && paper_runs == runs).then(|| Compared {
            name: &self.name,
            runs,
            filled: filled.map(|filled| filled.mean),
            means: METRICS.iter().map(means).collect(),
        })
    }
}

impl Compared<'_> {
    /// Adds a line for each metric to the CSV file.
    fn tabulate(&self, table: &mut Table) {
        let [of_paper, of_ours] = self.filled;
        for &(metric, [paper, ours]) in &self.means {
            let standing = match metric.standing([paper, ours]) {
                Ordering::Less => "behind",
                Ordering::Equal => "equal",
                Ordering::Greater => "ahead",
            };
            let mut row = vec![
                self.name.to_owned(),
                self.runs.to_string(),
                metric.key.to_owned(),
                exact(paper),
                exact(ours),
                standing.to_owned(),
            ];
            let numbers = [of_paper, of_ours, paper / of_paper, ours / of_ours];
            row.extend(numbers.map(exact));
            row.push(metric.why([paper, ours], self.filled).unwrap_or_default());
            table.row(row);
        }
    }

    /// The row of the summary; reasons become footnotes.
    fn summarise(&self, footnotes: &mut Vec<String>) -> Vec<String> {
        let [of_paper, of_ours] = self.filled.map(short);
        let mut row = vec![self.name.to_owned(), format!("{of_paper} / {of_ours}")];
        let mut reasons = Vec::new();
        for &(metric, means) in &self.means {
            let [paper, ours] = means.map(short);
            row.push(match metric.why(means, self.filled) {
                Some(reason) => {
                    reasons.push(format!("{} {}", metric.name, mark(footnotes, reason)));
                    format!("{paper} / {ours}")
                }
                None => format!("{paper} / **{ours}**"),
            });
        }
        row.push(reasons.join(", "));
        row
    }
}

/// The mark of a footnote; a new footnote is added.
fn mark(footnotes: &mut Vec<String>, footnote: String) -> String {
    let known = footnotes.iter().position(|known| *known == footnote);
    let number = known.unwrap_or(footnotes.len());
    if known.is_none() {
        footnotes.push(footnote);
    }
    letter(number)
}

/// (a) to (z), then numbers.
fn letter(number: usize) -> String {
    match (b'a'..=b'z').nth(number) {
        Some(letter) => format!("({})", char::from(letter)),
        None => format!("({number})"),
    }
}

impl Metric {
    /// Whether ours is behind (`Less`) or ahead (`Greater`).
    fn standing(&self, [paper, ours]: [f64; 2]) -> Ordering {
        let gain = if self.higher_is_better {
            ours - paper
        } else {
            paper - ours
        };
        if gain.abs() < 1e-9 {
            Ordering::Equal
        } else {
            gain.total_cmp(&0.0)
        }
    }

    /// Why ours is behind, if it is.
    fn why(&self, means: [f64; 2], filled: [f64; 2]) -> Option<String> {
        if self.standing(means).is_ge() {
            return None;
        }
        let sums_over_spots = matches!(self.key, "utility" | "distance_units");
        let holes = filled[1] - filled[0];
        if !sums_over_spots || holes <= 0.0 {
            return Some(self.reason.to_owned());
        }
        let shares = [means[0] / filled[0], means[1] / filled[1]];
        let [paper, ours] = shares;
        let left = format!(
            "the paper policy leaves {} spots empty; per filled spot {paper:.3} / {ours:.3}",
            short(holes)
        );
        Some(match self.standing(shares) {
            Ordering::Less => format!("{left}, and {}", self.reason),
            Ordering::Equal | Ordering::Greater => left,
        })
    }
}

fn rows(settings: &Settings) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |name: String, family: Family, size: usize| {
        let groups = PAPER_AND_OURS.map(|contender| Group::of(settings, family, size, contender));
        rows.push(Row { name, groups });
    };
    for &size in settings.sizes() {
        add(format!("mixed, {size}"), mixed, size);
    }
    let few = settings.few_spots();
    for &size in settings.surplus_sizes() {
        add(format!("mixed, {size} for {few} spots"), surplus, size);
    }
    for (trees, family) in [("lattice", lattice as Family), ("labelled", labelled)] {
        for &size in settings.equal_sizes() {
            add(format!("{trees}, all of {size}"), family, size);
        }
    }
    for &size in settings.sizes() {
        add(format!("singletons, {size}"), singletons, size);
    }
    for (number, case) in (1..).zip(&CASES) {
        let group = |contender| Group::new(contender, vec![Instance::CaseStudy(number)]);
        rows.push(Row {
            name: format!("case {number}, {}", case.name),
            groups: PAPER_AND_OURS.map(group),
        });
    }
    rows
}
