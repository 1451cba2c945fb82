//! Prioritised planning with make-way: unit by unit in the order of docking.

use super::field::{Failure, Field, NO_UNIT, Stop};
use super::lattice::Site;
use super::make_way::Bans;
use super::order::Order;
use super::route::STEP;
use super::units::Node;

/// What each cell that another unit holds adds to the cost of the path to a unit's spots.
const HELD: u32 = 30;
/// How often units may make way for one.
const ROUNDS_MAX: usize = 400;

/// How the units of a formation are brought to their spots.
pub(super) struct Docking<'a> {
    pub order: &'a Order,
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
        for &unit in &self.order.sequence {
            if !field.units[unit].pinned {
                self.dock(field, unit)?;
            }
        }
        Ok(())
    }

    /// The cells of the target's box and one around it.
    fn box_cells(&self, field: &Field) -> Vec<usize> {
        let (low, high) = self.target;
        let area = ((low.0 - 1, low.1 - 1), (high.0 + 1, high.1 + 1));
        field.arena.cells_between(area)
    }

    fn bans(&self, field: &Field) -> Bans {
        let mut cells = vec![false; field.arena.area()];
        if self.is_eager {
            for cell in self.box_cells(field) {
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
        let cells = self.box_cells(field);
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

    fn dock(&self, field: &mut Field, unit: usize) -> Result<(), Stop> {
        let Some(goal) = field.units[unit].goal else {
            return Ok(());
        };
        let parent = self.order.parents[unit].and_then(|parent| field.docked[parent]);
        let parent = parent.unwrap_or_default();
        let pockets = self.pockets(field, unit, goal);
        let mut blamed = None;
        for _ in 0..ROUNDS_MAX {
            let Some(route) = route_to(field, unit, goal)? else {
                break;
            };
            let mut kept_free = field.way(unit, &route);
            kept_free.extend(&pockets);
            let Some(other) = field.first_other(unit, &kept_free) else {
                if !field.move_to(unit, goal, parent)? {
                    break;
                }
                let time = field.since(unit).max(parent);
                field.settle(unit, time);
                return Ok(());
            };
            let mut bans = self.bans(field);
            bans.units.push(unit);
            for cell in kept_free {
                bans.cells[cell] = true;
            }
            blamed = Some(other);
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

    /// The cells of the target's box that a unit cuts off from its border when it docks, in ascending order.
    fn pockets(&self, field: &Field, unit: usize, goal: Node) -> Vec<usize> {
        let cells = self.box_cells(field);
        let mut is_shut = vec![true; field.arena.area()];
        for &cell in &cells {
            is_shut[cell] = field.solid[cell];
        }
        let mut was_shut = is_shut.clone();
        for cell in field.units[unit].cells(field.arena, goal) {
            is_shut[cell] = true;
        }
        let (low, high) = self.target;
        let is_border = |cell: usize| {
            let (x, y) = field.arena.site(cell);
            x < low.0 || x > high.0 || y < low.1 || y > high.1
        };
        for shut in [&mut is_shut, &mut was_shut] {
            let border = cells.iter().copied();
            let border = border.filter(|&cell| is_border(cell) && !shut[cell]);
            field.arena.flood(border.collect(), shut);
        }
        // Of those that were cut off before, none is needed by others.
        let is_newly_cut_off = |&cell: &usize| was_shut[cell] && !is_shut[cell];
        cells.into_iter().filter(is_newly_cut_off).collect()
    }
}

/// The cheapest route of a unit to its spots past docked units; passing the places of others is possible but costly.
pub(super) fn route_to(
    field: &mut Field,
    unit: usize,
    goal: Node,
) -> Result<Option<Vec<Node>>, Stop> {
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
