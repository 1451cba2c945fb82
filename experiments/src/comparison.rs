//! Ours against the paper policy on the same instances, with a reason wherever ours is not ahead.

use crate::case_studies::CASES;
use crate::contender::Contender;
use crate::figures::{equal, mixed, plans, sample, singletons, surplus};
use crate::instance::{Docked, Instance};
use crate::measure::plan::PlanMeasurement;
use crate::sample::{exact, short};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

/// The instances of one row.
struct Row<'a> {
    name: String,
    instance: Box<dyn Fn(u64) -> Instance + 'a>,
}

impl<'a> Row<'a> {
    fn new(name: String, instance: impl Fn(u64) -> Instance + 'a) -> Self {
        let instance = Box::new(instance);
        Self { name, instance }
    }
}

/// One number on which both are compared.
struct Metric {
    name: &'static str,
    key: &'static str,
    value: fn(&PlanMeasurement) -> f64,
    higher_is_better: bool,
    /// Why ours may be behind, apart from spots that the paper policy leaves empty.
    reason: &'static str,
}

const METRICS: [Metric; 6] = [
    Metric {
        name: "planning, ms",
        key: "planning_ms",
        value: |plan| plan.planning_us / 1e3,
        higher_is_better: false,
        reason: "the search for the best chain of evictions costs more than the paper's one test of two modules",
    },
    Metric {
        name: "utility",
        key: "utility",
        value: |plan| plan.utility,
        higher_is_better: true,
        reason: "a configuration first keeps as many modules together as can be, then looks at utility",
    },
    Metric {
        name: "distance, units",
        key: "distance_units",
        value: |plan| plan.distance,
        higher_is_better: false,
        reason: "modules that stay together go where they fit together, not each to the spot nearest to it",
    },
    Metric {
        name: "broken links",
        key: "broken_links",
        value: |plan| plan.broken_links as f64,
        higher_is_better: false,
        reason: "the units that chose earlier left no better place",
    },
    Metric {
        name: "messages, samples",
        key: "samples",
        value: |plan| (plan.claims + plan.evictions) as f64,
        higher_is_better: false,
        reason: "each eviction of a chain is announced, and each piece that breaks off takes a turn of its own, where the \
                 paper policy sends its modules one by one within the turn and our protocol carries that in one claim",
    },
    Metric {
        name: "messages, pairs delivered",
        key: "pairs_delivered",
        value: |plan| plan.pairs_delivered as f64,
        higher_is_better: false,
        reason: "a chain of evictions tells every spot that changes hands",
    },
];

/// What the comparison comes to.
pub(crate) struct Comparison {
    pub table: Table,
    pub text: String,
}

/// Compares all instances of which both plans are there; `None` if there are none.
pub(crate) fn compare(settings: &Settings, store: &Store) -> Option<Comparison> {
    let mut table = Table::new(&[
        "instances",
        "runs",
        "metric",
        "paper_policy_mean",
        "ours_mean",
        "ours_is",
        "paper_policy_filled_spots_mean",
        "ours_filled_spots_mean",
        "paper_policy_per_filled_spot",
        "ours_per_filled_spot",
        "reason",
    ]);
    let mut heads = vec!["instances", "spots filled"];
    heads.extend(METRICS.iter().map(|metric| metric.name));
    heads.push("where ours is not ahead");
    let mut summary = Table::new(&heads);
    let (mut ahead, mut all) = (0, 0);
    for row in rows(settings) {
        let paper = plans(settings, store, Contender::PaperPolicy, &row.instance);
        let ours = plans(settings, store, Contender::Ours, &row.instance);
        if ours.is_empty() || paper.len() != ours.len() {
            continue;
        }
        let filled =
            [&paper, &ours].map(|plans| sample(plans, |plan| plan.filled_spots as f64).mean);
        let mut shown = vec![
            row.name.clone(),
            format!("{} / {}", short(filled[0]), short(filled[1])),
        ];
        let mut reasons = Vec::new();
        for metric in &METRICS {
            let means = [&paper, &ours].map(|plans| sample(plans, metric.value).mean);
            let standing = Standing::of(metric, means);
            all += 1;
            ahead += usize::from(standing != Standing::Behind);
            let reason = match standing {
                Standing::Behind => metric.why(means, filled),
                Standing::Ahead | Standing::Equal => String::new(),
            };
            table.row(vec![
                row.name.clone(),
                ours.len().to_string(),
                metric.key.to_owned(),
                exact(means[0]),
                exact(means[1]),
                standing.name().to_owned(),
                exact(filled[0]),
                exact(filled[1]),
                exact(means[0] / filled[0]),
                exact(means[1] / filled[1]),
                reason.clone(),
            ]);
            let [of_paper, of_ours] = means.map(short);
            shown.push(match standing {
                Standing::Behind => format!("{of_paper} / {of_ours}"),
                Standing::Ahead | Standing::Equal => format!("{of_paper} / **{of_ours}**"),
            });
            if !reason.is_empty() {
                reasons.push(format!("{}: {reason}", metric.name));
            }
        }
        shown.push(reasons.join("; "));
        summary.row(shown);
    }
    if all == 0 {
        return None;
    }
    let text = format!(
        "Means over the same instances, paper policy / ours; **bold** where ours is ahead or equal, which it is in {ahead} of \
         {all}. Samples are claims and eviction notices, pairs the (spot, selector) pairs in claims times receivers; both \
         policies are carried by our protocol, which says only what changes. The paper's own algorithms broadcast the \
         whole set of pairs instead: see the sections on messages.\n\n{}",
        summary.to_markdown()
    );
    Some(Comparison { table, text })
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Standing {
    Ahead,
    Equal,
    Behind,
}

impl Standing {
    fn of(metric: &Metric, [paper, ours]: [f64; 2]) -> Self {
        let gain = if metric.higher_is_better {
            ours - paper
        } else {
            paper - ours
        };
        if gain.abs() < 1e-9 {
            Self::Equal
        } else if gain > 0.0 {
            Self::Ahead
        } else {
            Self::Behind
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Ahead => "ahead",
            Self::Equal => "equal",
            Self::Behind => "behind",
        }
    }
}

impl Metric {
    /// Why ours is behind.
    fn why(&self, means: [f64; 2], filled: [f64; 2]) -> String {
        let sums_over_spots = matches!(self.key, "utility" | "distance_units");
        let holes = filled[1] - filled[0];
        if !sums_over_spots || holes <= 0.0 {
            return self.reason.to_owned();
        }
        let shares = [means[0] / filled[0], means[1] / filled[1]];
        let left = format!(
            "the paper policy leaves {} spots empty; a filled spot {:.3} / {:.3}",
            short(holes),
            shares[0],
            shares[1]
        );
        match Standing::of(self, shares) {
            Standing::Behind => format!("{left}, and {}", self.reason),
            Standing::Ahead | Standing::Equal => left,
        }
    }
}

fn rows(settings: &Settings) -> Vec<Row<'_>> {
    let mut rows = Vec::new();
    for size in settings.sizes() {
        rows.push(Row::new(format!("mixed, {size}"), move |seed| {
            mixed(size, seed)
        }));
    }
    let few = settings.few_spots();
    for size in settings.surplus_sizes() {
        rows.push(Row::new(
            format!("mixed, {size} for {few} spots"),
            move |seed| surplus(settings, size, seed),
        ));
    }
    for (trees, docked) in [
        ("lattice", Docked::Lattice as fn(usize) -> Docked),
        ("labelled", Docked::Labelled),
    ] {
        for size in settings.equal_sizes() {
            rows.push(Row::new(format!("{trees}, all of {size}"), move |seed| {
                equal(settings, docked(size), seed)
            }));
        }
    }
    for size in settings.sizes() {
        rows.push(Row::new(format!("singletons, {size}"), move |seed| {
            singletons(size, seed)
        }));
    }
    for (number, case) in (1..).zip(&CASES) {
        // A case study is one instance, whatever the seed.
        let first = settings.seed;
        rows.push(Row::new(
            format!("case {number}, {}", case.name),
            move |seed| Instance::CaseStudy(if seed == first { number } else { 0 }),
        ));
    }
    rows
}
