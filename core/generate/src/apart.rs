//! Starts without contact, for scenarios whose modules move without contact.

use super::{BOX_SIDE_UNITS, HALF_TURN, Random, module_on_cell, tree::Cell};
use formation_model::{MICRO_PER_UNIT, MicroUnits, Pose, RawModule, RawScenario};

/// How the starts are kept apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Apart {
    /// Any pose and heading; the circles that hold the configurations and singletons are disjoint.
    Circles,
    /// Distinct cells of the target's lattice and headings in quarter turns.
    Cells,
}

/// How often a body's place is drawn before the field grows.
const DRAWS_MAX: usize = 2_000;

/// Draws the starts of a scenario again, in a square field about the target that is `percent` hundredths of the square
/// root of the number of modules wide. The field grows by twentieths until all starts fit.
pub fn set_apart(scenario: &mut RawScenario, apart: Apart, percent: u32, seed: u64) {
    let mut random = Random::from_seed(seed);
    let mut bodies: Vec<Vec<&mut RawModule>> = scenario
        .configurations
        .iter_mut()
        .map(|configuration| configuration.modules.iter_mut().collect())
        .collect();
    bodies.extend(scenario.singletons.iter_mut().map(|module| vec![module]));
    let modules: usize = bodies.iter().map(Vec::len).sum();
    let shapes: Vec<Shape> = bodies.iter().map(|body| Shape::of(body)).collect();
    let root = i64::try_from((modules as u64 * 1_000_000).isqrt()).unwrap_or(i64::MAX);
    let mut side = i64::from(percent) * root * (MICRO_PER_UNIT / 100_000);
    let places = loop {
        match places(&shapes, apart, side, &mut random) {
            Some(places) => break places,
            None => side += side / 20 + MICRO_PER_UNIT,
        }
    };
    for ((body, shape), place) in bodies.iter_mut().zip(&shapes).zip(places) {
        for (module, &cell) in body.iter_mut().zip(&shape.cells) {
            **module = module_on_cell(&place, module.id, cell);
        }
    }
}

/// A configuration or a singleton: the cells of its members about a middle one.
struct Shape {
    cells: Vec<Cell>,
    /// How far the corners reach from the middle of the middle cell, rounded up.
    radius: i64,
}

impl Shape {
    fn of(body: &[&mut RawModule]) -> Self {
        let first = &body[0];
        let (sine, cosine) = first.theta.sin_cos();
        let cells: Vec<Cell> = body
            .iter()
            .map(|module| {
                let (x, y) = (module.x - first.x, module.y - first.y);
                (whole(x * cosine + y * sine), whole(y * cosine - x * sine))
            })
            .collect();
        let reach = |&(x, y): &Cell| {
            let corner = |other: &Cell| {
                let (right, up) = (2 * (other.0 - x).abs() + 1, 2 * (other.1 - y).abs() + 1);
                i64::from(right * right + up * up)
            };
            cells.iter().map(corner).max().unwrap_or_default()
        };
        let middle = (0..cells.len()).min_by_key(|&member| (reach(&cells[member]), member));
        let (x, y) = middle.map(|member| cells[member]).unwrap_or_default();
        let half = MICRO_PER_UNIT / 2;
        Self {
            radius: (reach(&(x, y)) * half * half).isqrt() + 2,
            cells: cells.iter().map(|cell| (cell.0 - x, cell.1 - y)).collect(),
        }
    }
}

/// The whole number that a coordinate on a lattice stands for.
#[expect(
    clippy::cast_possible_truncation,
    reason = "offsets within a configuration are small"
)]
fn whole(along: f64) -> i32 {
    along.round() as i32
}

/// A place for each shape in a field, the largest first; none if one does not fit.
fn places(shapes: &[Shape], apart: Apart, side: i64, random: &mut Random) -> Option<Vec<Pose>> {
    let mut by_size: Vec<usize> = (0..shapes.len()).collect();
    by_size.sort_by_key(|&shape| (std::cmp::Reverse(shapes[shape].radius), shape));
    let mut places: Vec<Option<Pose>> = shapes.iter().map(|_| None).collect();
    let mut taken = std::collections::BTreeSet::new();
    for (rank, &shape) in by_size.iter().enumerate() {
        let drawn = (0..DRAWS_MAX).find_map(|_| {
            let place = draw(apart, side, random);
            match apart {
                Apart::Circles => by_size[..rank]
                    .iter()
                    .all(|&other| {
                        let reach = shapes[shape].radius + shapes[other].radius;
                        places[other].as_ref().is_none_or(|other| {
                            let (x, y) = ((place.x - other.x).0, (place.y - other.y).0);
                            i128::from(x).pow(2) + i128::from(y).pow(2) >= i128::from(reach).pow(2)
                        })
                    })
                    .then_some((place, Vec::new())),
                Apart::Cells => {
                    let cells = cells_of(&shapes[shape], &place);
                    (!cells.iter().any(|cell| taken.contains(cell))).then_some((place, cells))
                }
            }
        });
        let (place, cells) = drawn?;
        taken.extend(cells);
        places[shape] = Some(place);
    }
    places.into_iter().collect()
}

fn draw(apart: Apart, side: i64, random: &mut Random) -> Pose {
    let low = i64::from(BOX_SIDE_UNITS) * MICRO_PER_UNIT / 2 - side / 2;
    let mut below = |bound: i64| {
        i64::try_from(random.below(bound.max(0).unsigned_abs() + 1)).unwrap_or_default()
    };
    match apart {
        Apart::Circles => Pose {
            x: MicroUnits(low + below(side)),
            y: MicroUnits(low + below(side)),
            theta: MicroUnits(below(HALF_TURN.cast_signed())),
        },
        Apart::Cells => {
            let mut cell = || {
                let first = (low + MICRO_PER_UNIT / 2).div_euclid(MICRO_PER_UNIT);
                // A field is as many cells wide as its side, rounded.
                let cells = (side + MICRO_PER_UNIT / 2) / MICRO_PER_UNIT;
                (first + below(cells - 1)) * MICRO_PER_UNIT
            };
            let (x, y) = (cell(), cell());
            let quarter = [0, 1_570_796, 3_141_593, -1_570_796];
            Pose {
                x: MicroUnits(x),
                y: MicroUnits(y),
                theta: MicroUnits(quarter[usize::try_from(below(3)).unwrap_or_default()]),
            }
        }
    }
}

/// The cells that a shape covers at a place on the lattice.
fn cells_of(shape: &Shape, place: &Pose) -> Vec<(i64, i64)> {
    shape
        .cells
        .iter()
        .map(|&cell| {
            let module = module_on_cell(place, 0, cell);
            (i64::from(whole(module.x)), i64::from(whole(module.y)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GeneratorParameters, Grouping, generate};

    #[test]
    fn no_two_bodies_overlap_and_the_links_stay_one_unit_long() {
        for (seed, apart) in [(1, Apart::Circles), (2, Apart::Cells), (3, Apart::Cells)] {
            let parameters = GeneratorParameters::new(60, 60, seed).grouped(Grouping::Mixed);
            let mut scenario = generate(&parameters).unwrap();
            set_apart(&mut scenario, apart, 250, seed);
            let grouped = scenario.configurations.iter().flat_map(|it| &it.modules);
            let modules: Vec<&RawModule> = grouped.chain(&scenario.singletons).collect();
            for (index, one) in modules.iter().enumerate() {
                for other in &modules[..index] {
                    let distance = (one.x - other.x).hypot(one.y - other.y);
                    assert!(distance > 0.999_99, "{one:?} {other:?}");
                }
            }
            for configuration in &scenario.configurations {
                let at = |id: u32| *configuration.modules.iter().find(|it| it.id == id).unwrap();
                for &[one, other] in &configuration.edges {
                    let (one, other) = (at(one), at(other));
                    let distance = (one.x - other.x).hypot(one.y - other.y);
                    assert!((distance - 1.0).abs() < 1.0e-5);
                }
            }
        }
    }
}
