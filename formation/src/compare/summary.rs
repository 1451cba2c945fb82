//! The summaries: counts and means of each policy, and what the others differ from the first by, instance by instance.

use std::collections::BTreeMap;

use super::row::{Measures, Row, RowOutcome, Time};
use super::statistics::Estimate;

/// A measure with its name in tables.
type Measure = (&'static str, fn(&Measures) -> Option<f64>);

/// All measures of a row.
pub const MEASURES: [Measure; 12] = [
    ("filled", |row| Some(row.filled as f64)),
    ("total_utility", |row| Some(row.total_utility)),
    ("total_distance", |row| Some(row.total_distance)),
    ("longest_distance", |row| Some(row.longest_distance)),
    ("kept_links", |row| Some(row.kept_links as f64)),
    ("broken_links", |row| Some(row.broken_links as f64)),
    ("detached_modules", |row| Some(row.detached_modules as f64)),
    ("port_changes", |row| Some(row.port_changes as f64)),
    ("evictions", |row| Some(row.evictions as f64)),
    ("turns", |row| Some(row.turns as f64)),
    ("messages", |row| Some(row.messages as f64)),
    ("makespan", |row| row.makespan.map(f64::from)),
];

/// The values of a measure: for each policy, by instance.
type Values<'a> = BTreeMap<&'a str, BTreeMap<usize, f64>>;

const PAIRED: &str = "Differences are those of the same instance, policy less first policy, over the instances for which both \
                      planned completely; ± is the half width of the 95 % confidence interval by Student's t.";

/// The summary of what is the same on every machine.
pub fn of_rows(rows: &[Row], labels: &[&str]) -> String {
    let mut text = "# Policies compared\n".to_owned();
    text.push_str(&counts(rows, labels));
    let mut kinds: Vec<&str> = Vec::new();
    for row in rows {
        if !kinds.contains(&row.kind.as_str()) {
            kinds.push(&row.kind);
        }
    }
    text.push_str(&format!("\n{PAIRED}\n"));
    let all = |_: &Row| true;
    text.push_str(&tables("All instances", rows, labels, &all));
    if kinds.len() > 1 {
        for kind in kinds {
            text.push_str(&tables(kind, rows, labels, &|row| row.kind == kind));
        }
    }
    text
}

/// The summary of what the clock decides.
pub fn of_times(rows: &[Row], times: &[Time], labels: &[&str]) -> String {
    let mut values: Values = BTreeMap::new();
    for (number, (row, time)) in rows.iter().zip(times).enumerate() {
        if let (RowOutcome::Complete, Some(planning_us)) = (row.outcome, time.planning_us) {
            let of_policy = values.entry(&row.policy).or_default();
            of_policy.insert(number / labels.len().max(1), planning_us as f64);
        }
    }
    let mut text =
        "# Times\n\nMicroseconds for the decision; of a program, with its start and both texts.\n"
            .to_owned();
    text.push_str(&format!("\n{PAIRED}\n\n{}", HEAD));
    text.push_str(&lines("planning_us", &values, labels));
    text
}

/// How many instances of each policy came to which end.
fn counts(rows: &[Row], labels: &[&str]) -> String {
    const OUTCOMES: [RowOutcome; 5] = [
        RowOutcome::Complete,
        RowOutcome::Hole,
        RowOutcome::Refused,
        RowOutcome::Failed,
        RowOutcome::NoInstance,
    ];
    let heads: Vec<&str> = OUTCOMES.iter().map(|outcome| outcome.name()).collect();
    let mut text = format!(
        "\n| policy | rows | {} |\n|---|---:{}|\n",
        heads.join(" | "),
        "|---:".repeat(heads.len())
    );
    for label in labels {
        let own = || rows.iter().filter(|row| row.policy == *label);
        let ends = OUTCOMES.iter().map(|&outcome| {
            let count = own().filter(|row| row.outcome == outcome).count();
            count.to_string()
        });
        let ends: Vec<String> = ends.collect();
        text.push_str(&format!(
            "| `{label}` | {} | {} |\n",
            own().count(),
            ends.join(" | ")
        ));
    }
    text
}

const HEAD: &str = "| measure | policy | instances | mean | pairs | difference | less | equal | more |\n\
                    |---|---|---:|---:|---:|---:|---:|---:|---:|\n";

fn tables(title: &str, rows: &[Row], labels: &[&str], is_meant: &dyn Fn(&Row) -> bool) -> String {
    let mut text = format!("\n## {title}\n\n{HEAD}");
    for (name, measure) in MEASURES {
        let mut values: Values = BTreeMap::new();
        for (number, row) in rows.iter().enumerate() {
            let is_complete = row.outcome == RowOutcome::Complete && is_meant(row);
            let value = row
                .measures
                .as_ref()
                .filter(|_| is_complete)
                .and_then(measure);
            if let Some(value) = value {
                let of_policy = values.entry(&row.policy).or_default();
                of_policy.insert(number / labels.len().max(1), value);
            }
        }
        text.push_str(&lines(name, &values, labels));
    }
    text
}

/// The lines of one measure: the first policy, then the others with their differences from it.
fn lines(name: &str, values: &Values, labels: &[&str]) -> String {
    let mut text = String::new();
    let none = BTreeMap::new();
    let of = |label: &&str| values.get(*label).unwrap_or(&none);
    let Some(first) = labels.first().map(of) else {
        return text;
    };
    for (position, label) in labels.iter().enumerate() {
        let own: Vec<f64> = of(label).values().copied().collect();
        let Some(mean) = Estimate::of(&own) else {
            continue;
        };
        text.push_str(&format!(
            "| {name} | `{label}` | {} | {} |",
            mean.count,
            mean.text()
        ));
        let pairs = of(label).iter();
        let differences: Vec<f64> = pairs
            .filter_map(|(instance, value)| Some(value - first.get(instance)?))
            .collect();
        let paired = Estimate::of(&differences).filter(|_| position > 0);
        let rest = paired.map_or_else(
            || "  |  |  |  |  |".to_owned(),
            |paired| {
                let less = differences.iter().filter(|&&value| value < 0.0).count();
                let more = differences.iter().filter(|&&value| value > 0.0).count();
                let equal = differences.len() - less - more;
                let count = paired.count;
                format!(" {count} | {} | {less} | {equal} | {more} |", paired.text())
            },
        );
        text.push_str(&rest);
        text.push('\n');
    }
    text
}
