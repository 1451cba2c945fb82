//! Figure 10: eight case studies.

use super::{Experiment, Report};
use crate::case_studies::CASES;
use crate::cell::Cell;
use crate::contender::Contender;
use crate::instance::Instance;
use crate::paper;
use crate::plot::{Axis, Line, Look, Marker, Panel, Plot, Point, Series, colour};
use crate::sample::{exact, short};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const CASE_STUDIES: Experiment = Experiment {
    name: "case_studies",
    title: "Eight case studies",
    source: "Figure 10",
    cells,
    report,
};

/// How far markers of one case stand from each other, where cases are 1 apart.
const BESIDE: f64 = 0.2;

const CONTENDERS: [Contender; 2] = [Contender::PaperPolicy, Contender::Ours];

fn cells(_: &Settings) -> Vec<Cell> {
    let cases = 1..=CASES.len();
    cases
        .flat_map(|number| {
            CONTENDERS.map(|contender| Cell::Plan(Instance::CaseStudy(number), contender))
        })
        .collect()
}

fn report(_: &Settings, store: &Store) -> Report {
    let mut table = Table::new(&[
        "case",
        "name",
        "contender",
        "modules",
        "filled_spots",
        "planning_ms",
        "broken_links",
        "initial_links",
        "port_changes",
        "distance_units",
        "utility",
    ]);
    let mut summary = Table::new(&[
        "case",
        "formed",
        "modules",
        "paper's own case: ms, disconnections",
        "paper policy: ms, broken links, port changes",
        "ours: ms, broken links, port changes",
    ]);
    let mut times: [Vec<Point>; 2] = Default::default();
    let mut broken: [Vec<Point>; 2] = Default::default();
    let mut ports: [Vec<Point>; 2] = Default::default();
    for (place, case) in CASES.iter().enumerate() {
        let number = place + 1;
        let (stated_ms, stated_broken) = paper::CASES[place];
        let mut modules = 0;
        let mut cells = Vec::new();
        for (column, contender) in CONTENDERS.into_iter().enumerate() {
            let Some(plan) = store.plan(Cell::Plan(Instance::CaseStudy(number), contender)) else {
                continue;
            };
            modules = plan.receivers + 1;
            let milliseconds = plan.planning_us / 1e3;
            table.row(vec![
                number.to_string(),
                case.name.to_owned(),
                contender.key().to_owned(),
                modules.to_string(),
                plan.filled_spots.to_string(),
                exact(milliseconds),
                plan.broken_links.to_string(),
                plan.initial_links.to_string(),
                plan.port_changes.to_string(),
                exact(plan.distance),
                exact(plan.utility),
            ]);
            let holes = match plan.fillable_spots - plan.filled_spots {
                0 => String::new(),
                holes => format!(" ({holes} spots empty)"),
            };
            cells.push(format!(
                "{}, {}, {}{holes}",
                short(milliseconds),
                plan.broken_links,
                plan.port_changes
            ));
            // Beside each other, so that equal values do not hide each other.
            let x = place as f64 + BESIDE * (column as f64 - 0.5);
            times[column].push(Point::new(x, milliseconds));
            broken[column].push(Point::new(x, plan.broken_links as f64));
            ports[column].push(Point::new(x + BESIDE, plan.port_changes as f64));
        }
        let mut row = vec![
            number.to_string(),
            case.name.to_owned(),
            modules.to_string(),
            format!("{stated_ms}, {stated_broken}"),
        ];
        row.extend(cells);
        summary.row(row);
    }
    let stated = |value: fn(&(f64, usize)) -> f64| Series {
        name: "paper's own cases".to_owned(),
        look: Look::stated(),
        points: (0..)
            .zip(&paper::CASES)
            .map(|(place, case)| Point::new(f64::from(place) - 1.5 * BESIDE, value(case)))
            .collect(),
    };
    let names = || Axis::names("case", (1..=CASES.len()).map(|n| n.to_string()).collect());
    let [paper_times, our_times] = times;
    let [paper_broken, our_broken] = broken;
    let [_, our_ports] = ports;
    let series = |name: &str, look: Look, points| Series {
        name: name.to_owned(),
        look: look.with_line(Line::None),
        points,
    };
    let plot = Plot {
        title: "Eight case studies".to_owned(),
        panels: vec![
            Panel {
                title: "planning time".to_owned(),
                x: names(),
                y: Axis::logarithmic("planning time (ms)"),
                series: vec![
                    stated(|case| case.0),
                    series("paper policy", Contender::PaperPolicy.look(), paper_times),
                    series("ours", Contender::Ours.look(), our_times),
                ],
            },
            Panel {
                title: "what is taken apart".to_owned(),
                x: names(),
                y: Axis::from_zero("broken links, or port changes"),
                series: vec![
                    stated(|case| case.1 as f64),
                    series(
                        "paper policy: broken",
                        Contender::PaperPolicy.look(),
                        paper_broken,
                    ),
                    series("ours: broken links", Contender::Ours.look(), our_broken),
                    series(
                        "ours: port changes",
                        Look::new(colour::SKY, Marker::Triangle),
                        our_ports,
                    ),
                ],
            },
        ],
    };
    Report {
        table,
        plot,
        text: format!(
            "The cases are our own, so that they cannot be set against the paper's one by one; the paper's figures are \
             there for their size. The scenarios are in `launch_scripts/scenarios/case_studies`.\n\n{}",
            summary.to_markdown()
        ),
    }
}
