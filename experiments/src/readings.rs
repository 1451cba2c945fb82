//! Ours against both readings of the paper, metric by metric: how often ours is ahead, equal and behind.

use std::cmp::Ordering;

use crate::case_studies::CASES;
use crate::contender::READINGS_AND_OURS;
use crate::figures::{Data, Family, Group, Value, labelled, lattice, mixed, singletons};
use crate::instance::Instance;
use crate::measure::plan::PlanMeasurement;
use crate::sample::{exact, short};
use crate::settings::Settings;
use crate::table::Table;

/// One number by which plans are compared, with the same definition for all.
struct Metric {
    name: &'static str,
    key: &'static str,
    value: fn(&PlanMeasurement) -> f64,
    higher_is_better: bool,
}

const fn less(name: &'static str, key: &'static str, value: fn(&PlanMeasurement) -> f64) -> Metric {
    Metric {
        name,
        key,
        value,
        higher_is_better: false,
    }
}

const fn more(name: &'static str, key: &'static str, value: fn(&PlanMeasurement) -> f64) -> Metric {
    Metric {
        higher_is_better: true,
        ..less(name, key, value)
    }
}

const METRICS: [Metric; 10] = [
    more("spots filled", "filled_spots", |plan| {
        plan.filled_spots as f64
    }),
    less("broken links", "broken_links", |plan| {
        plan.broken_links as f64
    }),
    less(
        "outside the largest piece",
        "outside_largest_piece",
        |plan| plan.outside_largest_piece as f64,
    ),
    less("left alone", "alone", |plan| plan.alone as f64),
    less("distance, units", "distance_units", |plan| plan.distance),
    more("utility", "utility", |plan| plan.utility),
    less("planning, ms", "planning_ms", |plan| plan.planning_us / 1e3),
    less("decisions", "decisions", |plan| plan.broadcasts as f64),
    less(
        "samples, all by our protocol",
        "samples_same_protocol",
        |plan| (plan.claims + plan.evictions) as f64,
    ),
    less(
        "pairs delivered, all by our protocol",
        "pairs_same_protocol",
        |plan| plan.pairs_delivered as f64,
    ),
];

impl Metric {
    /// Whether ours is ahead (`Greater`) of another or behind.
    fn standing(&self, other: f64, ours: f64) -> Ordering {
        let gain = if self.higher_is_better {
            ours - other
        } else {
            other - ours
        };
        if gain.abs() < 1e-9 {
            Ordering::Equal
        } else {
            gain.total_cmp(&0.0)
        }
    }
}

/// The comparison of all instances that the three have planned.
pub(crate) struct Readings {
    pub table: Table,
    /// The table that the summary shows.
    pub results: String,
}

/// `None` if there are no such instances.
pub(crate) fn compare(data: &Data<'_>) -> Option<Readings> {
    let rows: Vec<(String, [Group; 3])> = rows(data.settings)
        .into_iter()
        .filter(|(_, groups)| is_complete(data, groups))
        .collect();
    if rows.is_empty() {
        return None;
    }
    let mut table = Table::new(
        "instances | metric | literal_mean | charitable_mean | ours_mean | against_literal | against_charitable",
    );
    let mut summary = Table::new(
        "metric | against literal: ahead / equal / behind | against charitable: ahead / equal / behind | \
         literal | charitable | ours",
    );
    for metric in &METRICS {
        let mut counts = [[0; 3]; 2];
        let mut sums = [0.0; 3];
        for (name, groups) in &rows {
            let means = groups
                .each_ref()
                .map(|group| data.sample(group, Value::Plan(metric.value)).mean);
            let [literal, charitable, ours] = means;
            let mut row = vec![name.clone(), metric.key.to_owned()];
            row.extend(means.map(exact));
            for (count, other) in counts.iter_mut().zip([literal, charitable]) {
                let (place, word) = match metric.standing(other, ours) {
                    Ordering::Greater => (0, "ahead"),
                    Ordering::Equal => (1, "equal"),
                    Ordering::Less => (2, "behind"),
                };
                count[place] += 1;
                row.push(word.to_owned());
            }
            for (sum, mean) in sums.iter_mut().zip(means) {
                *sum += mean;
            }
            table.row(row);
        }
        let mut row = vec![metric.name.to_owned()];
        row.extend(counts.map(|[ahead, equal, behind]| format!("{ahead} / {equal} / {behind}")));
        row.extend(sums.map(|sum| short(sum / rows.len() as f64)));
        summary.row(row);
    }
    Some(Readings {
        table,
        results: summary.to_markdown(),
    })
}

/// Whether all three have planned every instance.
fn is_complete(data: &Data<'_>, groups: &[Group; 3]) -> bool {
    let counts = groups.each_ref().map(|group| {
        data.sample(group, Value::Plan(|plan| plan.spots as f64))
            .count
    });
    counts[0] > 0 && counts.iter().all(|&count| count == counts[0])
}

fn rows(settings: &Settings) -> Vec<(String, [Group; 3])> {
    let mut rows = Vec::new();
    let mut add = |name: String, family: Family, size: usize| {
        let groups =
            READINGS_AND_OURS.map(|contender| Group::of(settings, family, size, contender));
        rows.push((name, groups));
    };
    for &size in settings.sizes() {
        add(format!("mixed, {size}"), mixed, size);
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
        let name = format!("case {number}, {}", case.name);
        rows.push((name, READINGS_AND_OURS.map(group)));
    }
    rows
}
