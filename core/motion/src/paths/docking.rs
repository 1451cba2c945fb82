//! Prioritised planning with make-way: unit by unit in the order of filling.

use super::lattice::Site;
use super::make_way::Bans;
use super::parts::Parts;
use super::route::STEP;
use super::schedule::{Failure, NO_UNIT, Schedule, Stop};
use super::units::Node;

/// What each cell that another unit holds adds to the cost of the path to a unit's spots.
const HELD: u32 = 30;
/// How often units may make way for one.
const ROUNDS_MAX: usize = 400;

/// How the units of a formation are brought to their spots.
pub(super) struct Docking<'a> {
    /// Units by position, in the order in which they fill their spots.
    pub filling: &'a [usize],
    /// The lowest and the highest column and row of the target.
    pub target: (Site, Site),
    /// Whether the target's box is emptied first.
    pub is_eager: bool,
}

impl Docking<'_> {
    /// Plans the paths of all units.
    pub fn run(&self, schedule: &mut Schedule) -> Result<(), Stop> {
        if self.is_eager {
            self.empty_box(schedule)?;
        }
        for &unit in self.filling {
            self.fill(schedule, unit)?;
        }
        Ok(())
    }

    /// The lowest and the highest column and row of the target's box and one around it.
    fn box_area(&self) -> (Site, Site) {
        let (low, high) = self.target;
        ((low.0 - 1, low.1 - 1), (high.0 + 1, high.1 + 1))
    }

    fn bans(&self, schedule: &Schedule) -> Bans {
        let mut cells = vec![false; schedule.arena.area()];
        if self.is_eager {
            for cell in schedule.arena.cells_between(self.box_area()) {
                cells[cell] = true;
            }
        }
        Bans {
            cells,
            units: Vec::new(),
        }
    }

    /// Moves all units out of the target's box, outermost first.
    fn empty_box(&self, schedule: &mut Schedule) -> Result<(), Stop> {
        let bans = self.bans(schedule);
        let cells = schedule.arena.cells_between(self.box_area());
        let (low, high) = self.target;
        let depth = |cell: usize| {
            let (x, y) = schedule.arena.site(cell);
            (x - low.0).min(high.0 - x).min(y - low.1).min(high.1 - y)
        };
        let mut inwards: Vec<(i64, usize)> =
            cells.iter().map(|&cell| (depth(cell), cell)).collect();
        inwards.sort_unstable();
        for _ in 0..2 * schedule.units.len() + ROUNDS_MAX {
            let found = inwards
                .iter()
                .map(|&(_, cell)| (cell, schedule.standing[cell]));
            let Some((_, unit)) = found
                .into_iter()
                .find(|&(cell, unit)| unit != NO_UNIT && !schedule.solid[cell])
            else {
                return Ok(());
            };
            if !schedule.make_way(unit, &bans, None)? {
                return Err(Stop::Failure(Failure {
                    unit,
                    in_the_way: None,
                }));
            }
        }
        Ok(())
    }

    /// Brings a unit to its spots. Before, those make way that stand on its path, and those whom it would cut off from their spots
    /// go to the side on which these are.
    fn fill(&self, schedule: &mut Schedule, unit: usize) -> Result<(), Stop> {
        let Some(goal) = schedule.units[unit].goal else {
            return Ok(());
        };
        let parts = Parts::of(schedule, unit, goal, self.box_area());
        let mut blamed = None;
        for _ in 0..ROUNDS_MAX {
            let Some(route) = route_to(schedule, unit, goal)? else {
                break;
            };
            let way = schedule.way(unit, &route);
            let on_the_way = schedule.first_other(unit, &way);
            let other = on_the_way.or_else(|| parts.first_cut_off(schedule, unit));
            let Some(other) = other else {
                if !schedule.move_to(unit, goal)? {
                    break;
                }
                schedule.settle(unit);
                return Ok(());
            };
            let mut bans = self.bans(schedule);
            bans.units.push(unit);
            for cell in way {
                bans.cells[cell] = true;
            }
            parts.ban_other_sides(schedule, other, &mut bans.cells);
            blamed = Some(other);
            if on_the_way.is_none() && schedule.relocate(other, &bans)? {
                continue;
            }
            let pushed = schedule.units[unit].is_simple().then_some(unit);
            if !schedule.make_way(other, &bans, pushed)? {
                break;
            }
        }
        Err(Stop::Failure(Failure {
            unit,
            in_the_way: blamed,
        }))
    }
}

/// The cheapest route of a unit to its spots past docked units; passing the places of others is possible but costly.
fn route_to(schedule: &mut Schedule, unit: usize, goal: Node) -> Result<Option<Vec<Node>>, Stop> {
    let (arena, body) = (schedule.arena, &schedule.units[unit]);
    let errand = schedule.errand(unit, true);
    let (standing, solid) = (&schedule.standing, &schedule.solid);
    let cost = |cell: usize| {
        let other = standing[cell];
        let is_held = other != NO_UNIT && other != unit;
        (!solid[cell]).then_some(if is_held { HELD } else { 0 })
    };
    let rest = |node: Node| body.distance(arena, node, goal) * STEP;
    let route = schedule
        .routes
        .find(&errand, cost, rest, |node| node == goal);
    schedule.check_budget()?;
    Ok(route)
}
