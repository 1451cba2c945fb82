//! Figure 4(a): the time to find the maximum common subtree, or the isomorphic subtree, of one configuration.

use super::{Experiment, Report, point};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::instance::{Docked, Instance};
use crate::plot::{Axis, Panel, Plot, Series};
use crate::sample::{Sample, exact};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const TIME: Experiment = Experiment {
    name: "matching_time",
    title: "Time to find where one configuration fits into a target of 100 spots",
    source: "Figure 4(a)",
    cells,
    report,
};

fn instance(settings: &Settings, size: usize, seed: u64) -> Instance {
    Instance::Generated {
        modules: size,
        spots: settings.full_size(),
        docked: Docked::Lattice(size),
        seed,
    }
}

fn cells(settings: &Settings) -> Vec<Cell> {
    let mut cells = Vec::new();
    for size in settings.configuration_sizes() {
        for seed in settings.seeds() {
            cells.push(Cell::Matching(instance(settings, size, seed)));
        }
    }
    cells
}

fn report(settings: &Settings, store: &Store) -> Report {
    let mut table = Table::new(&[
        "configuration_size",
        "spots",
        "runs",
        "ours_ms_mean",
        "ours_ms_std",
        "paper_policy_ms_mean",
        "paper_policy_ms_std",
        "matched_modules_mean",
        "candidates_mean",
        "ours_utility_mean",
        "paper_policy_utility_mean",
    ]);
    let mut summary = Table::new(&[
        "modules",
        "paper",
        "paper policy, ms",
        "ours, ms",
        "times faster",
        "utility, best of the paper policy's 20",
        "utility, ours",
    ]);
    let (mut ours_points, mut paper_points) = (Vec::new(), Vec::new());
    let (mut equal, mut searches) = (0, 0);
    for size in settings.configuration_sizes() {
        let cells: Vec<_> = settings
            .seeds()
            .into_iter()
            .filter_map(|seed| store.matching(Cell::Matching(instance(settings, size, seed))))
            .collect();
        searches += cells.len();
        equal += cells
            .iter()
            .filter(|cell| cell.ours_size == cell.paper_size)
            .count();
        let of = |value: &dyn Fn(&crate::measure::matching::MatchingMeasurement) -> f64| {
            Sample::of(cells.iter().map(|cell| value(cell)))
        };
        let ours = of(&|cell| cell.ours_us / 1e3);
        let paper = of(&|cell| cell.paper_us / 1e3);
        let matched = of(&|cell| cell.ours_size as f64);
        let candidates = of(&|cell| cell.candidates as f64);
        let ours_utility = of(&|cell| cell.ours_utility);
        let paper_utility = of(&|cell| cell.paper_utility);
        table.row(vec![
            size.to_string(),
            settings.full_size().to_string(),
            cells.len().to_string(),
            exact(ours.mean),
            exact(ours.deviation),
            exact(paper.mean),
            exact(paper.deviation),
            exact(matched.mean),
            exact(candidates.mean),
            exact(ours_utility.mean),
            exact(paper_utility.mean),
        ]);
        summary.row(vec![
            size.to_string(),
            "figure only".to_owned(),
            paper.short(),
            ours.short(),
            crate::sample::short(paper.mean / ours.mean),
            paper_utility.short(),
            ours_utility.short(),
        ]);
        ours_points.push(point(size as f64, ours));
        paper_points.push(point(size as f64, paper));
    }
    let plot = Plot {
        title: format!(
            "Finding a configuration's place among {} spots",
            settings.full_size()
        ),
        panels: vec![Panel {
            title: String::new(),
            x: Axis::from_zero("modules of the configuration"),
            y: Axis::logarithmic("time (ms)"),
            series: vec![
                Series {
                    name: "paper policy: first 20 common subtrees".to_owned(),
                    look: Contender::PaperPolicy.look(),
                    points: paper_points,
                },
                Series {
                    name: "ours: the common subtree of greatest utility".to_owned(),
                    look: Contender::Ours.look(),
                    points: ours_points,
                },
            ],
        }],
    };
    let text = format!(
        "{}\nUtilities are those of the matched modules alone. Both searches found parts of the same \
         size in {equal} of {searches} instances.\n",
        summary.to_markdown()
    );
    Report { table, plot, text }
}
