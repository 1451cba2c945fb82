//! Prioritised planning with make-way: unit by unit in the order of filling.

use super::field::{Failure, Field, NO_UNIT, Stop};
use super::lattice::Site;
use super::make_way::Bans;
use super::parts::Parts;
use super::route::STEP;
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
    pub fn run(&self, field: &mut Field) -> Result<(), Stop> {
        if self.is_eager {
            self.empty_box(field)?;
        }
        for &unit in self.filling {
            self.fill(field, unit)?;
        }
        Ok(())
    }

    /// The lowest and the highest column and row of the target's box and one around it.
    fn box_area(&self) -> (Site, Site) {
        let (low, high) = self.target;
        ((low.0 - 1, low.1 - 1), (high.0 + 1, high.1 + 1))
    }

    fn bans(&self, field: &Field) -> Bans {
        let mut cells = vec![false; field.arena.area()];
        if self.is_eager {
            for cell in field.arena.cells_between(self.box_area()) {
                cells[cell] = true;
            }
        }
        Bans {
            cells,
            units: Vec::new(),
        }
    }

    /// Moves all units out of the target's box, outermost first.
    fn empty_box(&self, field: &mut Field) -> Result<(), Stop> {
        let bans = self.bans(field);
        let cells = field.arena.cells_between(self.box_area());
        let (low, high) = self.target;
        let depth = |cell: usize| {
            let (x, y) = field.arena.site(cell);
            (x - low.0).min(high.0 - x).min(y - low.1).min(high.1 - y)
        };
        let mut inwards: Vec<(i64, usize)> =
            cells.iter().map(|&cell| (depth(cell), cell)).collect();
        inwards.sort_unstable();
        for _ in 0..2 * field.units.len() + ROUNDS_MAX {
            let found = inwards
                .iter()
                .map(|&(_, cell)| (cell, field.standing[cell]));
            let Some((_, unit)) = found
                .into_iter()
                .find(|&(cell, unit)| unit != NO_UNIT && !field.solid[cell])
            else {
                return Ok(());
            };
            if !field.make_way(unit, &bans, None)? {
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
    fn fill(&self, field: &mut Field, unit: usize) -> Result<(), Stop> {
        let Some(goal) = field.units[unit].goal else {
            return Ok(());
        };
        let parts = Parts::of(field, unit, goal, self.box_area());
        let mut blamed = None;
        for _ in 0..ROUNDS_MAX {
            let Some(route) = route_to(field, unit, goal)? else {
                break;
            };
            let way = field.way(unit, &route);
            let on_the_way = field.first_other(unit, &way);
            let other = on_the_way.or_else(|| parts.first_cut_off(field, unit));
            let Some(other) = other else {
                if !field.move_to(unit, goal)? {
                    break;
                }
                field.settle(unit);
                return Ok(());
            };
            let mut bans = self.bans(field);
            bans.units.push(unit);
            for cell in way {
                bans.cells[cell] = true;
            }
            parts.ban_other_sides(field, other, &mut bans.cells);
            blamed = Some(other);
            if on_the_way.is_none() && field.relocate(other, &bans)? {
                continue;
            }
            let pushed = field.units[unit].is_simple().then_some(unit);
            if !field.make_way(other, &bans, pushed)? {
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
fn route_to(field: &mut Field, unit: usize, goal: Node) -> Result<Option<Vec<Node>>, Stop> {
    let (arena, body) = (field.arena, &field.units[unit]);
    let errand = field.errand(unit, true);
    let (standing, solid) = (&field.standing, &field.solid);
    let cost = |cell: usize| {
        let other = standing[cell];
        let is_held = other != NO_UNIT && other != unit;
        (!solid[cell]).then_some(if is_held { HELD } else { 0 })
    };
    let rest = |node: Node| body.distance(arena, node, goal) * STEP;
    let route = field.routes.find(&errand, cost, rest, |node| node == goal);
    field.check_budget()?;
    Ok(route)
}
