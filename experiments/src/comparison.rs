//! Ours against both readings of the paper, metric by metric: how often ours is ahead, equal and behind.

use std::cmp::Ordering;

use crate::case_studies::CASES;
use crate::contender::READINGS_AND_OURS;
use crate::figures::{Data, Family, Group, Value, labelled, lattice, mixed, singletons, surplus};
use crate::instance::Instance;
use crate::sample::{exact, short};
use crate::settings::ExperimentSettings;
use crate::table::Table;

/// One number by which plans are compared.
struct Metric {
    /// What it is about; metrics of one family are neighbours.
    family: &'static str,
    name: &'static str,
    key: &'static str,
    paper: Value,
    ours: Value,
    higher_is_better: bool,
}

/// A number with the same definition for all, of which less is better.
const fn less(family: &'static str, name: &'static str, key: &'static str, value: Value) -> Metric {
    Metric {
        family,
        name,
        key,
        paper: value,
        ours: value,
        higher_is_better: false,
    }
}

/// A number with the same definition for all, of which more is better.
const fn more(family: &'static str, name: &'static str, key: &'static str, value: Value) -> Metric {
    Metric {
        higher_is_better: true,
        ..less(family, name, key, value)
    }
}

const BROADCASTS: Value = Value::Plan(|plan| plan.messages.broadcasts as f64);
/// Claims and eviction notices of our protocol.
const SAMPLES: Value = Value::Plan(|plan| (plan.messages.claims + plan.messages.evictions) as f64);
const PAIRS: Value = Value::Plan(|plan| plan.messages.pairs_delivered as f64);

const METRICS: [Metric; 14] = [
    less(
        "links",
        "broken links",
        "broken_links",
        Value::Plan(|plan| plan.links.broken as f64),
    ),
    less(
        "links",
        "port changes",
        "port_changes",
        Value::Plan(|plan| plan.links.port_changes as f64),
    ),
    less(
        "disconnected",
        "outside the largest piece",
        "outside_largest_piece",
        Value::Plan(|plan| plan.disconnected.outside_largest_piece as f64),
    ),
    less(
        "disconnected",
        "left alone",
        "alone",
        Value::Plan(|plan| plan.disconnected.alone as f64),
    ),
    less(
        "distance",
        "distance",
        "distance_units",
        Value::Plan(|plan| plan.distance),
    ),
    more(
        "distance",
        "utility",
        "utility",
        Value::Plan(|plan| plan.utility),
    ),
    more(
        "completion",
        "spots filled",
        "filled_spots",
        Value::Plan(|plan| plan.filled_spots as f64),
    ),
    less(
        "messages, each by its own algorithm",
        "decisions",
        "decisions",
        BROADCASTS,
    ),
    Metric {
        paper: BROADCASTS,
        ..less(
            "messages, each by its own algorithm",
            "decisions and notices",
            "samples",
            SAMPLES,
        )
    },
    Metric {
        paper: Value::Plan(|plan| plan.whole_set_pairs() as f64),
        ..less(
            "messages, each by its own algorithm",
            "pairs delivered",
            "pairs_delivered",
            PAIRS,
        )
    },
    less(
        "messages, same protocol",
        "samples",
        "samples_same_protocol",
        SAMPLES,
    ),
    less(
        "messages, same protocol",
        "pairs delivered",
        "pairs_same_protocol",
        PAIRS,
    ),
    less(
        "time",
        "planning time",
        "planning_ms",
        Value::PlanTime(|plan| plan.planning_us / 1e3),
    ),
    more(
        "completion",
        "spots selected after half of the planning time",
        "selected_percent_at_half_time",
        Value::PlanTime(|plan| plan.selected_after(50.0)),
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

/// How often ours is ahead, equal and behind.
#[derive(Clone, Copy, Default)]
struct Standing([usize; 3]);

impl Standing {
    fn add(&mut self, ordering: Ordering) {
        let [ahead, equal, behind] = &mut self.0;
        *match ordering {
            Ordering::Greater => ahead,
            Ordering::Equal => equal,
            Ordering::Less => behind,
        } += 1;
    }

    fn sum(standings: impl Iterator<Item = Self>) -> Self {
        standings.fold(Self::default(), |Self(sum), Self(one)| {
            Self([sum[0] + one[0], sum[1] + one[1], sum[2] + one[2]])
        })
    }

    fn text(self) -> String {
        let [ahead, equal, behind] = self.0;
        format!("{ahead}/{equal}/{behind}")
    }

    fn sentence(self) -> String {
        let [ahead, equal, behind] = self.0;
        let all = ahead + equal + behind;
        format!("ahead in {ahead}, equal in {equal} and behind in {behind} of {all} numbers")
    }
}

/// The instances of one row, and the groups of the literal reading, the charitable one, and ours.
struct Row {
    /// The kind of instances: a column of the table of losses.
    kind: &'static str,
    name: String,
    groups: [Group; 3],
}

/// A metric over all rows.
struct Compared {
    metric: &'static Metric,
    /// For each row, the three means, and how ours stands against the two readings.
    rows: Vec<([f64; 3], [Ordering; 2])>,
}

impl Compared {
    fn standings(&self) -> [Standing; 2] {
        [0, 1].map(|reading| {
            let mut standing = Standing::default();
            for (_, orderings) in &self.rows {
                standing.add(orderings[reading]);
            }
            standing
        })
    }
}

/// The comparison of all instances that the three have planned.
pub(crate) struct Comparison {
    /// CSV files by name, a line for each metric and row.
    pub tables: [(&'static str, Table); 2],
    /// The text and the tables of the page by name.
    pub blocks: Vec<(&'static str, String)>,
}

/// `None` if there are no such instances.
pub(crate) fn compare(data: &Data<'_>) -> Option<Comparison> {
    let rows = rows(data.settings);
    let rows: Vec<Row> = rows
        .into_iter()
        .filter(|row| row.is_complete(data))
        .collect();
    if rows.is_empty() {
        return None;
    }
    let (timed, counted): (Vec<Compared>, Vec<Compared>) = METRICS
        .iter()
        .map(|metric| Compared {
            metric,
            rows: rows.iter().map(|row| row.compare(metric, data)).collect(),
        })
        .partition(|compared| compared.metric.ours.is_timed());
    let all = counted.iter().chain(&timed);
    let blocks = vec![
        ("headline", headline(all)),
        ("standing", standing(&counted).to_markdown()),
        ("standing_times", standing(&timed).to_markdown()),
        ("losses", losses(&rows, &counted).to_markdown()),
        ("losses_times", losses(&rows, &timed).to_markdown()),
        ("at_full_size", at_full_size(&rows, &counted).to_markdown()),
    ];
    Some(Comparison {
        tables: [
            ("comparison", each_mean(data, &rows, &counted)),
            ("comparison_times", each_mean(data, &rows, &timed)),
        ],
        blocks,
    })
}

/// One sentence that counts every metric in every row.
fn headline<'a>(compared: impl Iterator<Item = &'a Compared>) -> String {
    let standings: Vec<[Standing; 2]> = compared.map(Compared::standings).collect();
    let [literal, charitable] =
        [0, 1].map(|reading| Standing::sum(standings.iter().map(|both| both[reading])).sentence());
    format!(
        "**Against the literal reading ours is {literal}; against the charitable one it is {charitable}.**\n"
    )
}

/// The standing by metric, and the sum.
fn standing(compared: &[Compared]) -> Table {
    let mut table = Table::new(
        "family | metric | against literal: ahead/equal/behind | against charitable: ahead/equal/behind",
    );
    for one in compared {
        let mut row = vec![one.metric.family.to_owned(), one.metric.name.to_owned()];
        row.extend(one.standings().map(Standing::text));
        table.row(row);
    }
    let mut row = vec!["all".to_owned(), String::new()];
    row.extend(
        [0, 1].map(|reading| {
            Standing::sum(compared.iter().map(|one| one.standings()[reading])).text()
        }),
    );
    table.row(row);
    table
}

/// By metric and kind of instances, in how many rows ours is behind.
fn losses(rows: &[Row], compared: &[Compared]) -> Table {
    let mut kinds: Vec<(&'static str, usize)> = Vec::new();
    for row in rows {
        match kinds.iter_mut().find(|(kind, _)| *kind == row.kind) {
            Some((_, count)) => *count += 1,
            None => kinds.push((row.kind, 1)),
        }
    }
    let heads = kinds
        .iter()
        .map(|(kind, count)| format!("{kind}, of {count}"));
    let heads: Vec<String> = std::iter::once("metric".to_owned()).chain(heads).collect();
    Table::of(&heads.join(" | "), compared, |one| {
        let behind = |kind: &str, reading: usize| {
            let of_kind = rows
                .iter()
                .zip(&one.rows)
                .filter(|(row, _)| row.kind == kind);
            of_kind
                .filter(|(_, (_, orderings))| orderings[reading].is_lt())
                .count()
        };
        let name = match one.metric.family {
            "messages, same protocol" => format!("{}, same protocol", one.metric.name),
            _ => one.metric.name.to_owned(),
        };
        let counts =
            kinds.iter().map(
                |(kind, _)| match [0, 1].map(|reading| behind(kind, reading)) {
                    [0, 0] => String::new(),
                    [literal, charitable] => format!("{literal}, {charitable}"),
                },
            );
        std::iter::once(name).chain(counts).collect()
    })
}

/// The means of the last row of each kind, of the metrics that are about plans.
fn at_full_size(rows: &[Row], compared: &[Compared]) -> Table {
    let shown: Vec<&Compared> = compared
        .iter()
        .filter(|one| !one.metric.family.starts_with("messages"))
        .collect();
    let mut heads = vec!["literal/charitable/ours"];
    heads.extend(shown.iter().map(|one| one.metric.name));
    let is_last = |(number, row): &(usize, &Row)| {
        row.kind != CASE_STUDIES
            && rows
                .get(number + 1)
                .is_none_or(|next| next.kind != row.kind)
    };
    let last = rows.iter().enumerate().filter(is_last);
    Table::of(&heads.join(" | "), last, |(number, row)| {
        let means = shown
            .iter()
            .map(|one| one.rows[number].0.map(short).join("/"));
        std::iter::once(row.name.clone()).chain(means).collect()
    })
}

/// The three means of each metric in each row.
fn each_mean(data: &Data<'_>, rows: &[Row], compared: &[Compared]) -> Table {
    let mut table = Table::new(
        "instances | runs | family | metric | literal_mean | charitable_mean | ours_mean | against_literal | \
         against_charitable",
    );
    for (number, row) in rows.iter().enumerate() {
        for one in compared {
            let (means, orderings) = one.rows[number];
            let mut cells = vec![
                row.name.clone(),
                data.sample(&row.groups[2], one.metric.ours)
                    .count
                    .to_string(),
                one.metric.family.to_owned(),
                one.metric.key.to_owned(),
            ];
            cells.extend(means.map(exact));
            cells.extend(orderings.map(|ordering| {
                match ordering {
                    Ordering::Greater => "ahead",
                    Ordering::Equal => "equal",
                    Ordering::Less => "behind",
                }
                .to_owned()
            }));
            table.row(cells);
        }
    }
    table
}

impl Row {
    /// Whether all three have planned every instance.
    fn is_complete(&self, data: &Data<'_>) -> bool {
        let counts = self.groups.each_ref().map(|group| {
            data.sample(group, Value::Plan(|plan| plan.spots as f64))
                .count
        });
        counts[0] > 0 && counts.iter().all(|&count| count == counts[0])
    }

    fn compare(&self, metric: &Metric, data: &Data<'_>) -> ([f64; 3], [Ordering; 2]) {
        let [literal, charitable, ours] = &self.groups;
        let paper = [literal, charitable].map(|group| data.sample(group, metric.paper).mean);
        let ours = data.sample(ours, metric.ours).mean;
        let orderings = paper.map(|other| metric.standing(other, ours));
        ([paper[0], paper[1], ours], orderings)
    }
}

const CASE_STUDIES: &str = "case studies";

fn rows(settings: &ExperimentSettings) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |kind, name: String, family: Family, size: usize| {
        let groups =
            READINGS_AND_OURS.map(|contender| Group::of(settings, family, size, contender));
        rows.push(Row { kind, name, groups });
    };
    for &size in settings.sizes() {
        add("mixed", format!("mixed, {size}"), mixed, size);
    }
    let few = settings.few_spots();
    for &size in settings.surplus_sizes().iter().filter(|&&size| size != few) {
        let name = format!("mixed, {size} for {few} spots");
        add("mixed, fewer spots", name, surplus, size);
    }
    for (trees, family) in [("lattice", lattice as Family), ("labelled", labelled)] {
        for &size in settings.equal_sizes() {
            add(trees, format!("{trees}, all of {size}"), family, size);
        }
    }
    for &size in settings.sizes() {
        add(
            "singletons",
            format!("singletons, {size}"),
            singletons,
            size,
        );
    }
    for (number, case) in (1..).zip(&CASES) {
        let group = |contender| Group::new(contender, vec![Instance::CaseStudy(number)]);
        rows.push(Row {
            kind: CASE_STUDIES,
            name: format!("case {number}, {}", case.name),
            groups: READINGS_AND_OURS.map(group),
        });
    }
    rows
}
