//! What is valid in a scenario and yet looks like a mistake.

use std::collections::BTreeMap;
use std::fmt::Display;

use formation_model::text::counted;
use formation_model::{BodyShape, MICRO_PER_UNIT, MicroUnits, PlanningProblem, Pose};

/// A module is one unit wide; poses are written with a few decimals, so a little less still counts as apart.
const WIDTH_MIN: MicroUnits = MicroUnits(MICRO_PER_UNIT - TOLERANCE.0);
const TOLERANCE: MicroUnits = MicroUnits(10_000);
/// Front, left, back and right.
const PORTS: usize = 4;
/// Round modules have as many neighbours in a hexagonal lattice.
const PORTS_OF_ROUND: usize = 6;

/// At most one sentence for each kind of oddity, which names the first place and says how many there are.
pub fn of(problem: &PlanningProblem) -> Vec<String> {
    let (modules, spots) = (problem.modules(), problem.target().spots());
    let topology = problem.target().topology();
    let edges = topology.edges().iter();
    let links = modules.iter().flat_map(|module| {
        let others = module.links.range(module.id..);
        others
            .filter_map(|&other| problem.module(other))
            .map(move |other| ((module.id, module.pose), (other.id, other.pose)))
    });
    let ports = match problem.target().surroundings().body() {
        BodyShape::Square => PORTS,
        BodyShape::Circle => PORTS_OF_ROUND,
    };
    let mut degrees = spots.iter().zip(0..);
    [
        uneven_numbers(problem),
        crowding(
            "target.spots",
            spots.iter().map(|spot| (spot.id, spot.pose)),
            WIDTH_MIN,
        ),
        // Where modules stand at the start is not restricted, but two at the very same place are one copied line.
        crowding(
            "modules",
            modules.iter().map(|module| (module.id, module.pose)),
            MicroUnits(1),
        ),
        odd_lengths(
            "target.edges",
            edges
                .map(|&(one, other)| (&spots[one], &spots[other]))
                .map(|(one, other)| ((one.id, one.pose), (other.id, other.pose))),
        ),
        odd_lengths("configurations", links),
        degrees.find_map(|(spot, node)| {
            overfull("target.edges", spot.id, topology.degree(node), ports)
        }),
        modules
            .iter()
            .find_map(|module| overfull("configurations", module.id, module.links.len(), ports)),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// More spots than modules, or the other way round.
fn uneven_numbers(problem: &PlanningProblem) -> Option<String> {
    let (modules, spots) = (problem.modules().len(), problem.target().spots().len());
    if modules > spots {
        let spare = counted(modules - spots, "module");
        return Some(format!(
            "modules: more than spots; {spare} will stay without a spot"
        ));
    }
    let open = counted(spots - modules, "spot");
    (modules < spots).then(|| {
        let parameters = problem.parameters();
        if parameters.trims_target() {
            return format!("modules: fewer than spots; the target will be trimmed by {open}");
        }
        let reason = if parameters.keep_all_spots {
            "planner.keep_all_spots is set".to_owned()
        } else {
            format!("the policy {} does not trim", parameters.policy.name())
        };
        format!(
            "modules: fewer than spots; {open} will stay open, and as {reason}, the rest may fall apart"
        )
    })
}

/// A spot or module with more neighbours than a module has ports.
fn overfull(field: &str, id: impl Display, degree: usize, ports: usize) -> Option<String> {
    (degree > ports)
        .then(|| format!("{field}: {id} has {degree} neighbours; a module has {ports} ports"))
}

/// Finds all that stands nearer than `least` to something listed before it.
///
/// Only what keeps its distance is remembered, so each cell of the grid holds a handful at most and crowds cost no more.
fn crowding<Id: Copy + Display>(
    field: &str,
    placed: impl Iterator<Item = (Id, Pose)>,
    least: MicroUnits,
) -> Option<String> {
    let mut grid: BTreeMap<(i64, i64), Vec<(Id, Pose)>> = BTreeMap::new();
    let mut first = None;
    let mut count = 0;
    for (id, pose) in placed {
        let cell = (pose.x.0.div_euclid(least.0), pose.y.0.div_euclid(least.0));
        let near = (-1..=1)
            .flat_map(|dx| (-1..=1).map(move |dy| (cell.0 + dx, cell.1 + dy)))
            .filter_map(|cell| grid.get(&cell))
            .flatten()
            .find(|(_, other)| pose.distance_to(other) < least);
        if let Some(&(other, place)) = near {
            count += 1;
            first.get_or_insert((other, id, pose.distance_to(&place)));
        } else {
            grid.entry(cell).or_default().push((id, pose));
        }
    }
    let (one, other, distance) = first?;
    let how = if distance == MicroUnits::ZERO {
        "are at the same place".to_owned()
    } else {
        format!(
            "are only {} units apart, and a module is 1 unit wide",
            distance.to_units()
        )
    };
    Some(format!(
        "{field}: {one} and {other} {how}{}",
        and_more(count)
    ))
}

/// Finds docked neighbours that are not one unit apart.
fn odd_lengths<Id: Copy + Display>(
    field: &str,
    links: impl Iterator<Item = ((Id, Pose), (Id, Pose))>,
) -> Option<String> {
    let mut odd = links.filter_map(|(one, other)| {
        let length = one.1.distance_to(&other.1);
        let is_odd = (length - MicroUnits::ONE).0.abs() > TOLERANCE.0;
        is_odd.then_some((one.0, other.0, length))
    });
    let (one, other, length) = odd.next()?;
    Some(format!(
        "{field}: {one} and {other} are joined and {} units apart, docked modules are 1 unit apart{}",
        length.to_units(),
        and_more(1 + odd.count())
    ))
}

fn and_more(count: usize) -> String {
    match count {
        0 | 1 => String::new(),
        more => format!(" (and {} more such)", more - 1),
    }
}
