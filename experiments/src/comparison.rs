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
    paper: Value,
    ours: Value,
    higher_is_better: bool,
    /// Whether the summary shows it; the CSV file always does.
    is_shown: bool,
    /// Why ours may be behind, apart from spots that the paper policy leaves empty.
    reason: &'static str,
}

type Value = fn(&PlanMeasurement) -> f64;

impl Metric {
    /// A number that both have in the same way, and of which less is better.
    const fn same(
        name: &'static str,
        key: &'static str,
        value: Value,
        reason: &'static str,
    ) -> Self {
        Self {
            name,
            key,
            paper: value,
            ours: value,
            higher_is_better: false,
            is_shown: true,
            reason,
        }
    }
}

const NOTICES: &str = "an eviction notice tells the evicted module and whoever watches, once for each eviction, and \
                       changes nothing; optimal chains make more evictions than the paper policy, which has no notices";
const PIECES: &str = "each piece of two or more modules that breaks off looks for a place again, in a turn of its own, \
                      before its modules go alone";

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
            "a configuration first keeps as many modules together as can be and only then looks at utility; the paper \
             policy breaks more links, and single modules find nearer spots",
        )
    },
    Metric::same(
        "distance, units",
        "distance_units",
        |plan| plan.distance,
        "modules that stay together go where they fit together; the paper policy breaks more links, and single modules \
         find nearer spots",
    ),
    Metric::same(
        "broken links",
        "broken_links",
        |plan| plan.broken_links as f64,
        "units choose one after another, so a larger fit of an earlier one can cost a later one more",
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
        is_shown: true,
        reason: NOTICES,
    },
    Metric {
        name: "pairs delivered",
        key: "pairs_delivered",
        paper: |plan| plan.whole_set_pairs() as f64,
        ours: |plan| plan.pairs_delivered as f64,
        higher_is_better: false,
        is_shown: true,
        reason: "chains tell every spot that changes hands",
    },
    Metric {
        is_shown: false,
        ..Metric::same(
            "samples, both by our protocol",
            "samples_same_protocol",
            |plan| (plan.claims + plan.evictions) as f64,
            "optimal chains make more evictions, and pieces take turns of their own; our protocol carries all that a \
             configuration of the paper policy decides in one claim",
        )
    },
    Metric {
        is_shown: false,
        ..Metric::same(
            "pairs delivered, both by our protocol",
            "pairs_same_protocol",
            |plan| plan.pairs_delivered as f64,
            "chains tell every spot that changes hands",
        )
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
    let is_shown = |metric: &&Metric| metric.is_shown;
    heads.extend(METRICS.iter().filter(is_shown).map(|metric| metric.name));
    heads.push("where ours is not ahead");
    let mut summary = Table::new(&heads);
    let (mut ahead, mut all) = (0, 0);
    let mut footnotes: Vec<String> = Vec::new();
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
            let means = [
                sample(&paper, metric.paper).mean,
                sample(&ours, metric.ours).mean,
            ];
            let standing = Standing::of(metric, means);
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
            if !metric.is_shown {
                continue;
            }
            all += 1;
            ahead += usize::from(standing != Standing::Behind);
            let [of_paper, of_ours] = means.map(short);
            shown.push(match standing {
                Standing::Behind => format!("{of_paper} / {of_ours}"),
                Standing::Ahead | Standing::Equal => format!("{of_paper} / **{of_ours}**"),
            });
            if !reason.is_empty() {
                reasons.push(format!("{} {}", metric.name, mark(&mut footnotes, reason)));
            }
        }
        shown.push(reasons.join(", "));
        summary.row(shown);
    }
    if all == 0 {
        return None;
    }
    let mut text = format!(
        "Means over the same instances, paper policy / ours; **bold** where ours is ahead or equal, which it is in {ahead} of \
         {all}. Messages are counted as each one's own algorithm asks for them. Decisions: claims of ours; the paper's \
         broadcasts of the set of pairs, one a turn and one for each module disconnected. Pairs delivered: (spot, selector) \
         pairs times receivers; the paper's broadcasts repeat the whole set, claims say what changes. `comparison.csv` has \
         both counts with the paper policy carried by our protocol too.\n\n{}\n",
        summary.to_markdown()
    );
    for (number, footnote) in footnotes.iter().enumerate() {
        text.push_str(&format!("- {} {footnote}\n", letter(number)));
    }
    Some(Comparison { table, text })
}

/// The mark of a footnote, which is added if it is new.
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
