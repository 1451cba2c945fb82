//! Attempts to plan: order and paths of the units; blocks that do not get in are taken apart.

use super::lattice::{Site, Time};
use super::lattice_request::{Crew, LatticeRequest};
use super::order::Formation;
use super::output::Draft;
use super::rectangle::bounds;
use super::result::{MotionError, Obstruction};
use super::variants::Ground;
use formation_model::MotionPlan;

/// After this many tries to plan with blocks, all are taken apart.
const TRIES_MAX: usize = 12;

/// What comes of an attempt to plan.
enum Attempt {
    Solved(Box<MotionPlan>),
    /// These blocks do not get to their spots; none if single modules among blocks do not.
    Blamed(Vec<usize>),
}

impl LatticeRequest<'_> {
    /// Plans; takes blocks apart until all units get to their spots.
    pub fn plan(&self) -> Result<MotionPlan, MotionError> {
        let blocks = &self.request.plan.blocks;
        let mut apart = vec![false; blocks.len()];
        let taken = self.spot_of.iter().flatten();
        let taken: Vec<Site> = taken.map(|&spot| self.spots[spot]).collect();
        let target = if taken.is_empty() {
            bounds(&self.spots)
        } else {
            bounds(&taken)
        };
        self.check_ways()?;
        let ready = self.ready();
        let mut spent = 0;
        let mut attempt = 0;
        loop {
            let mut crew = self.crew(&apart);
            let blamed = match self.attempt(&mut crew, target, &ready, &mut spent)? {
                Attempt::Blamed(blamed) => blamed,
                Attempt::Solved(mut plan) => {
                    let names = blocks.iter().zip(&apart).filter(|(_, apart)| **apart);
                    plan.taken_apart = names.map(|(block, _)| block.clone()).collect();
                    return Ok(*plan);
                }
            };
            // Each round takes a block apart, and without blocks an attempt solves or fails.
            self.take_apart(&crew, &blamed, attempt, &mut apart);
            attempt += 1;
        }
    }

    /// Orders and plans the units.
    fn attempt(
        &self,
        crew: &mut Crew,
        target: (Site, Site),
        ready: &[Time],
        spent: &mut u64,
    ) -> Result<Attempt, MotionError> {
        let formation = Formation {
            on_lattice: self,
            arena: &self.arena,
            units: &crew.units,
            ranks: &crew.ranks,
            target,
        };
        let filling = match formation.filling_order() {
            Ok(filling) => filling,
            Err(stuck) => {
                let block = stuck.block.ok_or_else(|| {
                    let unit = &crew.units[stuck.unit];
                    let reason = match self.exits(unit) {
                        true => Obstruction::NoExit,
                        false => Obstruction::Full,
                    };
                    self.unreachable_for(unit, reason)
                })?;
                return Ok(Attempt::Blamed(vec![block]));
            }
        };
        for (unit, exit) in filling.exits.into_iter().enumerate() {
            if let Some(exit) = exit {
                crew.units[unit].leave_by(exit, &self.arena);
            }
        }
        let crew = &*crew;
        let mut parameters = self.request.parameters;
        parameters.expansions_max = parameters.expansions_max.saturating_sub(*spent);
        let ground = Ground {
            arena: &self.arena,
            units: &crew.units,
            ready,
            filling: &filling.order,
            target,
            parameters: &parameters,
        };
        match ground.solve() {
            Ok(solution) => {
                let draft = Draft {
                    on_lattice: self,
                    crew,
                    solution: &solution,
                    spent: *spent,
                };
                Ok(Attempt::Solved(Box::new(draft.plan())))
            }
            Err(failed) => {
                let (schedule, failure) = *failed;
                *spent += schedule.expansions();
                if crew.units.iter().all(|unit| !unit.is_block()) {
                    return Err(self.unreachable(&schedule, &failure));
                }
                let units = [Some(failure.unit), failure.in_the_way]
                    .into_iter()
                    .flatten();
                let blocks = units.filter(|&unit| crew.units[unit].is_block());
                Ok(Attempt::Blamed(blocks.collect()))
            }
        }
    }

    fn take_apart(&self, crew: &Crew, blamed: &[usize], attempt: usize, apart: &mut [bool]) {
        let before = apart.iter().filter(|&&is_apart| is_apart).count();
        for &unit in blamed {
            let lead = self.request.problem.modules()[crew.units[unit].modules[0]].id;
            for (index, block) in self.request.plan.blocks.iter().enumerate() {
                apart[index] |= block.contains(&lead);
            }
        }
        let after = apart.iter().filter(|&&is_apart| is_apart).count();
        if attempt + 1 >= TRIES_MAX || after == before {
            apart.fill(true);
        }
    }
}
