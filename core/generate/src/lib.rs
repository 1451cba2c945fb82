//! Random scenarios from a seed: the instances of the paper's "Experimental Evaluation".
//!
//! Leaders and singletons start uniformly in a box of 16 by 16 units with headings uniform in `[0, pi]`. The members of a
//! configuration start on the unit lattice of their leader's pose and share its heading. They, like the target, can reach
//! beyond the box, and modules of different configurations can overlap, as in the paper. The target is axis-aligned, and
//! its bounding rectangle is centred on the box up to half a unit.
//!
//! A scenario is plain data: planning draws no random numbers.

mod apart;
mod on_cells;
mod random;
mod tree;

use nalgebra::{UnitComplex, Vector2};
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use apart::{Apart, set_apart};
use formation_model::{
    MICRO_PER_UNIT, MODULES_MAX, MicroUnits, PlannerParameters, Pose, RawConfiguration, RawModule,
    RawScenario, RawSpot, RawTarget, SPOTS_MAX,
};
pub use on_cells::{LatticeCell, on_cells};
pub use random::Random;
use tree::{Cell, DrawnTree};

/// The side of the box in which leaders and singletons start, in units.
const BOX_SIDE_UNITS: u32 = 16;
/// The sizes of the configurations of a mixed scenario, as in the paper.
const MIXED_SIZES: std::ops::RangeInclusive<usize> = 2..=10;

/// Half a turn in micro-radians, rounded down.
const HALF_TURN: u64 = 3_141_592;

/// The grouping of the modules at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grouping {
    /// Every module starts alone.
    #[default]
    Singletons,
    /// As many configurations of this size as possible; the other modules start alone.
    Configurations(usize),
    /// This many configurations of one size; the other modules start alone.
    Equal {
        /// How many.
        count: usize,
        /// The modules of each.
        size: usize,
    },
    /// A uniformly random number of singletons; the others form configurations of sizes uniform in 2 to 10. A single module
    /// that is left over starts alone.
    Mixed,
}

/// The distribution of the trees of targets and configurations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TreeKind {
    /// Grown cell by cell on the unit lattice.
    #[default]
    Lattice,
    /// Uniform among all labelled trees. Only for measurements of topology: the poses do not follow the links.
    UniformLabelled,
}

/// The parameters of a random scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GeneratorParameters {
    /// The number of modules, 1 to [`MODULES_MAX`].
    pub modules: usize,
    /// The number of spots, 1 to [`SPOTS_MAX`].
    pub spots: usize,
    /// The grouping of the modules.
    pub grouping: Grouping,
    /// The distribution of the trees.
    pub tree: TreeKind,
    /// The greatest number of links of a spot or a module, 3 or 4.
    pub degree_max: usize,
    /// The side of the box in which leaders and singletons start, in units, 1 to 16.
    pub start_side_units: u32,
    /// The seed; equal parameters give the same scenario on every machine.
    pub seed: u64,
}

impl GeneratorParameters {
    /// Singletons on lattice trees of maximum degree 3.
    pub fn new(modules: usize, spots: usize, seed: u64) -> Self {
        Self {
            modules,
            spots,
            grouping: Grouping::default(),
            tree: TreeKind::default(),
            degree_max: 3,
            start_side_units: BOX_SIDE_UNITS,
            seed,
        }
    }

    /// Sets the grouping.
    #[must_use]
    pub fn grouped(self, grouping: Grouping) -> Self {
        Self { grouping, ..self }
    }
}

/// Why a scenario cannot be generated.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum GenerateError {
    /// A count is out of its range.
    #[error("{field} must be {least} to {most}, got {given}")]
    OutOfRange {
        /// The name of the count in the command.
        field: &'static str,
        /// The least allowed value.
        least: usize,
        /// The greatest allowed value.
        most: usize,
        /// The given value.
        given: usize,
    },
    /// No draw gave a tree.
    #[error("found no tree of {node_count} nodes with this seed; try another seed")]
    NoTreeFound {
        /// The number of nodes of the tree.
        node_count: usize,
    },
}

/// The width of the field of [`generate_apart`], in hundredths of the square root of the number of modules.
const APART_PERCENT: u32 = 300;

/// Generates a scenario whose modules start apart, so that each can turn without touching another.
///
/// # Errors
/// Names the parameter that is out of its range.
pub fn generate_apart(parameters: &GeneratorParameters) -> Result<RawScenario, GenerateError> {
    let mut scenario = generate(parameters)?;
    set_apart(
        &mut scenario,
        Apart::Circles,
        APART_PERCENT,
        parameters.seed,
    );
    Ok(scenario)
}

/// Generates a scenario. Modules may start where others are, as in the paper.
///
/// # Errors
/// Names the parameter that is out of its range.
pub fn generate(parameters: &GeneratorParameters) -> Result<RawScenario, GenerateError> {
    let group_limit = match parameters.grouping {
        Grouping::Configurations(size) => size,
        Grouping::Equal { count, size } => count.saturating_mul(size),
        Grouping::Singletons | Grouping::Mixed => 1,
    };
    let group_field = match parameters.grouping {
        Grouping::Equal { .. } => "configurations, in modules,",
        _ => "configuration-size",
    };
    let start_side = usize::try_from(parameters.start_side_units).unwrap_or(usize::MAX);
    let box_side = usize::try_from(BOX_SIDE_UNITS).unwrap_or(usize::MAX);
    for (field, given, least, most) in [
        ("modules", parameters.modules, 1, MODULES_MAX),
        ("spots", parameters.spots, 1, SPOTS_MAX),
        ("degree", parameters.degree_max, 3, 4),
        ("start-side", start_side, 1, box_side),
        (group_field, group_limit, 1, parameters.modules),
    ] {
        if given < least || given > most {
            return Err(GenerateError::OutOfRange {
                field,
                least,
                most,
                given,
            });
        }
    }
    let mut random = Random::from_seed(parameters.seed);
    let target = generate_target(parameters, &mut random)?;
    let sizes = group_sizes(parameters, &mut random);
    let alone = parameters.modules - sizes.iter().sum::<usize>();
    let mut configurations = Vec::with_capacity(sizes.len());
    let mut ids = 1_u32..;
    for (number, size) in (1..).zip(sizes) {
        let members: Vec<u32> = ids.by_ref().take(size).collect();
        let configuration = generate_configuration(number, &members, parameters, &mut random)?;
        configurations.push(configuration);
    }
    let mut singleton = |id| module_on_cell(&draw_start(parameters, &mut random), id, (0, 0));
    Ok(RawScenario {
        name: name_of(parameters),
        target,
        configurations,
        singletons: ids.take(alone).map(&mut singleton).collect(),
        planner: PlannerParameters::default(),
        module_size: None,
        body: formation_model::BodyShape::default(),
        body_width: None,
        obstacles: Vec::new(),
        arena: None,
        given: None,
        in_parts: false,
    })
}

fn name_of(parameters: &GeneratorParameters) -> String {
    let grouping = match parameters.grouping {
        Grouping::Singletons => "singletons".to_owned(),
        Grouping::Configurations(size) => format!("configurations-of-{size}"),
        Grouping::Equal { count, size } => format!("{count}-configurations-of-{size}"),
        Grouping::Mixed => "mixed".to_owned(),
    };
    format!(
        "{}-modules-{}-spots-{grouping}-seed-{}",
        parameters.modules, parameters.spots, parameters.seed
    )
}

fn draw_tree(
    node_count: usize,
    parameters: &GeneratorParameters,
    random: &mut Random,
) -> Result<DrawnTree, GenerateError> {
    match parameters.tree {
        TreeKind::Lattice => Ok(tree::lattice(node_count, parameters.degree_max, random)),
        TreeKind::UniformLabelled => {
            tree::uniform_labelled(node_count, parameters.degree_max, random)
        }
    }
}

fn generate_target(
    parameters: &GeneratorParameters,
    random: &mut Random,
) -> Result<RawTarget, GenerateError> {
    let tree = draw_tree(parameters.spots, parameters, random)?;
    let side = i32::try_from(BOX_SIDE_UNITS).unwrap_or_default();
    // A shift by whole units keeps the spots on the lattice of the frame.
    let shift = |coordinates: &dyn Fn(&Cell) -> i32| {
        let least = tree.cells.iter().map(coordinates).min().unwrap_or_default();
        let most = tree.cells.iter().map(coordinates).max().unwrap_or_default();
        (side - least - most).div_euclid(2)
    };
    let (right, up) = (shift(&|cell| cell.0), shift(&|cell| cell.1));
    let spots: Vec<RawSpot> = (1..)
        .zip(&tree.cells)
        .map(|(id, &(column, row))| RawSpot {
            id,
            x: f64::from(column + right),
            y: f64::from(row + up),
            theta: 0.0,
        })
        .collect();
    let edges = tree.edges.iter();
    Ok(RawTarget {
        frame_id: "map".to_owned(),
        edges: edges
            .map(|&(one, other)| [spots[one].id, spots[other].id])
            .collect(),
        spots,
    })
}

fn group_sizes(parameters: &GeneratorParameters, random: &mut Random) -> Vec<usize> {
    match parameters.grouping {
        Grouping::Singletons | Grouping::Configurations(1) | Grouping::Equal { size: 1, .. } => {
            Vec::new()
        }
        Grouping::Equal { count, size } => vec![size; count],
        Grouping::Configurations(size) => vec![size; parameters.modules / size],
        Grouping::Mixed => {
            let mut rest = parameters.modules - random.index(parameters.modules + 1);
            let mut sizes = Vec::new();
            let (least, most) = MIXED_SIZES.into_inner();
            while rest >= least {
                let size = least + random.index(rest.min(most) - least + 1);
                sizes.push(size);
                rest -= size;
            }
            sizes
        }
    }
}

fn generate_configuration(
    id: u32,
    members: &[u32],
    parameters: &GeneratorParameters,
    random: &mut Random,
) -> Result<RawConfiguration, GenerateError> {
    let tree = draw_tree(members.len(), parameters, random)?;
    let leader = random.index(members.len());
    let (column, row) = tree.cells[leader];
    let start = draw_start(parameters, random);
    Ok(RawConfiguration {
        id,
        leader: Some(members[leader]),
        modules: members
            .iter()
            .zip(&tree.cells)
            .map(|(&member, cell)| module_on_cell(&start, member, (cell.0 - column, cell.1 - row)))
            .collect(),
        edges: tree
            .edges
            .iter()
            .map(|&(one, other)| [members[one], members[other]])
            .collect(),
    })
}

/// Draws the pose at which a singleton or a leader starts.
fn draw_start(parameters: &GeneratorParameters, random: &mut Random) -> Pose {
    let side = u64::from(parameters.start_side_units) * MICRO_PER_UNIT.unsigned_abs();
    let mut within = |limit: u64| {
        let number = random.below(limit + 1);
        MicroUnits(i64::try_from(number).unwrap_or_default())
    };
    Pose {
        x: within(side),
        y: within(side),
        theta: within(HALF_TURN),
    }
}

/// A module on a cell of the lattice of a pose.
///
/// Coordinates are rounded to micro-units, which hides the last bit of a sine, in which mathematical libraries differ.
fn module_on_cell(start: &Pose, id: u32, (column, row): Cell) -> RawModule {
    let theta = start.theta.to_units();
    let offset = UnitComplex::new(theta) * Vector2::new(f64::from(column), f64::from(row));
    // An offset is at most the configuration's size, far below the limit of a coordinate.
    let quantised = |offset| MicroUnits::from_units(offset).unwrap_or_default();
    RawModule {
        id,
        x: (start.x + quantised(offset.x)).to_units(),
        y: (start.y + quantised(offset.y)).to_units(),
        theta,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::{ModuleId, Scenario};
    use std::collections::BTreeSet;

    fn text(parameters: &GeneratorParameters) -> String {
        serde_yaml::to_string(&generate(parameters).unwrap()).unwrap()
    }

    #[test]
    fn every_scenario_is_valid_and_of_the_size_asked_for() {
        let mut seed = 0;
        for tree in [TreeKind::Lattice, TreeKind::UniformLabelled] {
            for (modules, spots) in [(1, 1), (2, 7), (30, 12), (100, 100)] {
                for grouping in [
                    Grouping::Singletons,
                    Grouping::Configurations(1.max(modules / 4)),
                    Grouping::Configurations(modules),
                    Grouping::Mixed,
                ] {
                    seed += 1;
                    let parameters = GeneratorParameters {
                        tree,
                        grouping,
                        ..GeneratorParameters::new(modules, spots, seed)
                    };
                    let scenario = Scenario::from_yaml(&text(&parameters)).unwrap();
                    assert_eq!(scenario.problem().modules().len(), modules);
                    assert_eq!(scenario.problem().target().spots().len(), spots);
                    assert!(scenario.problem().target().topology().is_tree());
                    assert!(
                        scenario
                            .problem()
                            .modules()
                            .iter()
                            .all(|module| module.links.len() <= 3)
                    );
                }
            }
        }
    }

    #[test]
    fn the_seed_alone_decides() {
        let parameters = GeneratorParameters::new(40, 40, 1).grouped(Grouping::Mixed);
        assert_eq!(text(&parameters), text(&parameters));
        let texts: BTreeSet<String> = (0..50)
            .map(|seed| {
                let mut scenario = generate(&GeneratorParameters { seed, ..parameters }).unwrap();
                scenario.name.clear();
                serde_yaml::to_string(&scenario).unwrap()
            })
            .collect();
        assert_eq!(texts.len(), 50);
    }

    /// Published experiments name seeds, so a change of these values is a break with them.
    #[test]
    fn seeds_keep_their_meaning() {
        let scenario = generate(&GeneratorParameters::new(1, 5, 42)).unwrap();
        let cells: Vec<(f64, f64)> = scenario
            .target
            .spots
            .iter()
            .map(|spot| (spot.x, spot.y))
            .collect();
        let module = scenario.singletons[0];
        assert_eq!(
            cells,
            [(8.0, 7.0), (9.0, 7.0), (7.0, 7.0), (7.0, 8.0), (6.0, 7.0)]
        );
        let micro = |value| MicroUnits::from_units(value).unwrap().0;
        assert_eq!(
            (micro(module.x), micro(module.y), micro(module.theta)),
            (15_527_622, 6_007_403, 590_331)
        );
    }

    #[test]
    fn members_stand_on_the_lattice_of_their_leader() {
        let parameters = GeneratorParameters::new(60, 10, 5).grouped(Grouping::Configurations(12));
        let scenario = Scenario::try_from(generate(&parameters).unwrap()).unwrap();
        let problem = scenario.problem();
        let configurations = problem.configurations();
        assert_eq!(configurations.len(), 5);
        for configuration in configurations {
            assert_eq!(configuration.modules.len(), 12);
            let leader = problem.module(configuration.leader).unwrap();
            assert_eq!(leader.leader, Some(leader.id));
            for &member in &configuration.modules {
                let module = problem.module(member).unwrap();
                assert_eq!(module.pose.theta, leader.pose.theta);
                for &other in &module.links {
                    let distance = module
                        .pose
                        .distance_to(&problem.module(other).unwrap().pose);
                    assert!((distance.0 - MICRO_PER_UNIT).abs() <= 3, "{distance}");
                }
            }
            let distinct: BTreeSet<_> = configuration
                .modules
                .iter()
                .filter_map(|&id: &ModuleId| problem.module(id))
                .map(|module| (module.pose.x, module.pose.y))
                .collect();
            assert_eq!(distinct.len(), 12);
        }
    }

    #[test]
    fn starts_fill_the_box_and_the_half_turn() {
        let scenario = generate(&GeneratorParameters::new(4_000, 50, 3)).unwrap();
        let spread = |value: &dyn Fn(&RawModule) -> f64, limit: f64| {
            let values: Vec<f64> = scenario.singletons.iter().map(value).collect();
            assert!(values.iter().all(|value| (0.0..=limit).contains(value)));
            let mean = values.iter().sum::<f64>() / 4_000.0;
            assert!((mean / limit - 0.5).abs() < 0.025, "{mean} of {limit}");
            assert!(values.iter().any(|value| *value < limit * 0.01));
            assert!(values.iter().any(|value| *value > limit * 0.99));
        };
        spread(&|module| module.x, 16.0);
        spread(&|module| module.y, 16.0);
        spread(&|module| module.theta, std::f64::consts::PI);
        let centre = Scenario::try_from(scenario.clone())
            .unwrap()
            .problem()
            .target()
            .centre();
        assert!((centre.x.to_units() - 8.0).abs() < 4.0);
        assert!((centre.y.to_units() - 8.0).abs() < 4.0);
    }

    #[test]
    fn mixed_scenarios_have_the_papers_sizes() {
        let mut sizes = BTreeSet::new();
        let mut singletons = BTreeSet::new();
        for seed in 0..200 {
            let parameters = GeneratorParameters::new(50, 50, seed).grouped(Grouping::Mixed);
            let scenario = generate(&parameters).unwrap();
            sizes.extend(scenario.configurations.iter().map(|one| one.modules.len()));
            singletons.insert(scenario.singletons.len());
        }
        assert_eq!(sizes, MIXED_SIZES.collect());
        assert!(singletons.len() > 40);
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let refusal = |change: &dyn Fn(&mut GeneratorParameters)| {
            let mut parameters = GeneratorParameters::new(10, 10, 0);
            change(&mut parameters);
            generate(&parameters).unwrap_err().to_string()
        };
        assert_eq!(
            refusal(&|parameters| parameters.modules = 0),
            "modules must be 1 to 10000, got 0"
        );
        assert_eq!(
            refusal(&|parameters| parameters.degree_max = 2),
            "degree must be 3 to 4, got 2"
        );
        assert_eq!(
            refusal(&|parameters| parameters.grouping = Grouping::Configurations(11)),
            "configuration-size must be 1 to 10, got 11"
        );
        assert_eq!(
            refusal(&|parameters| parameters.grouping = Grouping::Configurations(0)),
            "configuration-size must be 1 to 10, got 0"
        );
    }
}
