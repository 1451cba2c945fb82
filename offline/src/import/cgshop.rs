//! Instances of the CG:SHOP Challenge 2021, Coordinated Motion Planning: robots on cells, each with a cell to go to.
//!
//! The format is that of the contest's package `cgshop2021-pyutils`: `name`, `starts`, `targets` and `obstacles`, each a list of
//! `[x, y]`. Robot r becomes the module r, and its target the spot r.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, bail, ensure};
use formation_generate::LatticeCell;
use formation_model::{
    BodyShape, MODULES_MAX, NAME_BYTES_MAX, PlannerParameters, Policy, RawGiven, RawGivenSpot,
    RawPlacement, RawScenario, RawTarget, Topology,
};
use serde::Deserialize;

use super::grid::Run;

/// The furthest cell from the origin, along either axis.
const COORDINATE_MAX: i64 = 100_000;

/// The file. Further keys are those of other programs.
#[derive(Deserialize)]
struct Instance {
    name: Option<String>,
    starts: Vec<LatticeCell>,
    targets: Vec<LatticeCell>,
    obstacles: Vec<LatticeCell>,
}

/// Reads an instance: its scenario without obstacles, and these as runs. `name` is that of its file.
///
/// # Errors
/// Names the entry that is wrong.
pub fn read(text: &str, name: &str) -> anyhow::Result<(RawScenario, Vec<Run>)> {
    let instance: Instance =
        serde_json::from_str(text).context("is no instance of CG:SHOP 2021")?;
    let (starts, targets) = (&instance.starts, &instance.targets);
    ensure!(
        starts.len() == targets.len(),
        "has {} starts and {} targets",
        starts.len(),
        targets.len()
    );
    ensure!(!starts.is_empty(), "has no robots");
    ensure!(
        starts.len() <= MODULES_MAX,
        "has {} robots; at most {MODULES_MAX} are supported",
        starts.len()
    );
    check_cells("obstacles", &instance.obstacles)?;
    let obstacles: BTreeSet<LatticeCell> = instance.obstacles.iter().copied().collect();
    check_robots("starts", starts, &obstacles)?;
    let spots = check_robots("targets", targets, &obstacles)?;
    let edges = adjacent(&spots);
    let links: Vec<(usize, usize)> = edges
        .iter()
        .map(|&[one, other]| (one as usize, other as usize))
        .collect();
    let in_parts = Topology::new(targets.len(), &links).components().len() > 1;
    let mut name = instance.name.unwrap_or_else(|| name.to_owned());
    while name.len() > NAME_BYTES_MAX {
        name.pop();
    }
    let allocation = (0..).zip(targets);
    let scenario = RawScenario {
        name,
        target: RawTarget {
            frame_id: "map".to_owned(),
            spots: placed(targets),
            edges,
        },
        configurations: Vec::new(),
        singletons: placed(starts),
        planner: PlannerParameters {
            policy: Policy::Given,
            keep_all_spots: in_parts,
            ..PlannerParameters::default()
        },
        module_size: None,
        body: BodyShape::default(),
        body_width: None,
        obstacles: Vec::new(),
        arena: None,
        given: Some(RawGiven {
            allocation: allocation
                .map(|(robot, _)| RawGivenSpot {
                    module: robot,
                    spot: robot,
                })
                .collect(),
            detached: Vec::new(),
        }),
        in_parts,
    };
    Ok((scenario, runs(&obstacles)))
}

fn check_cells(list: &str, cells: &[LatticeCell]) -> anyhow::Result<()> {
    let is_far = |&(x, y): &LatticeCell| x.abs().max(y.abs()) > COORDINATE_MAX;
    match cells.iter().position(is_far) {
        Some(index) => {
            let (x, y) = cells[index];
            bail!("{list}[{index}]: [{x}, {y}] is further than {COORDINATE_MAX} from the origin")
        }
        None => Ok(()),
    }
}

/// The robot of each cell.
fn check_robots(
    list: &str,
    cells: &[LatticeCell],
    obstacles: &BTreeSet<LatticeCell>,
) -> anyhow::Result<BTreeMap<LatticeCell, u32>> {
    check_cells(list, cells)?;
    let mut robots = BTreeMap::new();
    for (robot, cell) in (0..).zip(cells) {
        let (x, y) = cell;
        ensure!(
            !obstacles.contains(cell),
            "{list}[{robot}]: [{x}, {y}] is an obstacle"
        );
        if let Some(other) = robots.insert(*cell, robot) {
            bail!("{list}[{robot}]: [{x}, {y}] is {list}[{other}] already");
        }
    }
    Ok(robots)
}

/// The pairs of spots side by side, ascending.
fn adjacent(spots: &BTreeMap<LatticeCell, u32>) -> Vec<[u32; 2]> {
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for (&(x, y), &spot) in spots {
        let next = [(x + 1, y), (x, y + 1)].into_iter();
        let others = next.filter_map(|cell| spots.get(&cell).copied());
        pairs.extend(others.map(|other| [spot.min(other), spot.max(other)]));
    }
    pairs.sort_unstable();
    pairs
}

#[expect(
    clippy::cast_precision_loss,
    reason = "the coordinates have been checked"
)]
fn placed(cells: &[LatticeCell]) -> Vec<RawPlacement> {
    let numbered = (0..).zip(cells);
    numbered
        .map(|(id, &(x, y))| RawPlacement {
            id,
            x: x as f64,
            y: y as f64,
            theta: 0.0,
        })
        .collect()
}

/// Cells side by side in a row as one.
fn runs(cells: &BTreeSet<LatticeCell>) -> Vec<Run> {
    let mut rows: Vec<LatticeCell> = cells.iter().map(|&(x, y)| (y, x)).collect();
    rows.sort_unstable();
    let mut runs: Vec<Run> = Vec::new();
    for (y, x) in rows {
        match runs.last_mut() {
            Some(last) if last.y == y && last.end() == x => last.length += 1,
            _ => runs.push(Run { x, y, length: 1 }),
        }
    }
    runs
}
