//! The variants of the planner and the choice between them.

use super::docking::Docking;
use super::improve::improve;
use super::lattice::{Arena, Site, Time};
use super::result::MotionParameters;
use super::schedule::{Failure, Schedule, Scheduling, Stop};
use super::units::Unit;
use formation_model::Variant;

/// What all variants plan on.
pub(super) struct Ground<'a> {
    pub arena: &'a Arena,
    pub units: &'a [Unit],
    pub ready: &'a [Time],
    /// Units by position, in the order in which they fill their spots.
    pub filling: &'a [usize],
    /// The lowest and the highest column and row of the target.
    pub target: (Site, Site),
    pub parameters: &'a MotionParameters,
}

/// The paths that were chosen.
pub(super) struct Solution<'a> {
    pub schedule: Schedule<'a>,
    pub variant: Variant,
    pub expansions: u64,
}

/// A failure with the plan at its time.
pub(super) type Failed<'a> = (Schedule<'a>, Failure);

impl<'a> Ground<'a> {
    /// Plans lazily and, for few units, eagerly; the plan that ends earlier is chosen, then the one of fewer steps.
    /// When there is no plan, the serial variant follows: lazily if the budget was spent, and eagerly.
    pub fn solve(&self) -> Result<Solution<'a>, Box<Failed<'a>>> {
        let mut spent = 0;
        let mut best: Option<(Schedule<'a>, Variant)> = None;
        let mut failed = None;
        // Lazily and eagerly.
        let mut has_failed = [false; 2];
        let movers = self.units.iter().filter(|unit| !unit.stays).count();
        let eager = (movers <= self.parameters.eager_units_max).then_some(Variant::Eager);
        for variant in std::iter::once(Variant::Lazy).chain(eager) {
            let (schedule, outcome) = self.attempt(variant, spent);
            spent += schedule.expansions();
            match outcome {
                Ok(()) => {
                    if best
                        .as_ref()
                        .is_none_or(|(other, _)| schedule.cost() < other.cost())
                    {
                        best = Some((schedule, variant));
                    }
                }
                Err(Stop::Budget) => {}
                Err(Stop::Failure(failure)) => {
                    has_failed[usize::from(variant == Variant::Eager)] = true;
                    failed.get_or_insert((schedule, failure));
                }
            }
        }
        if best.is_none() {
            // Where units cannot make way, other times do not help.
            let untried = [false, true].into_iter();
            for is_eager in untried.filter(|&is_eager| !has_failed[usize::from(is_eager)]) {
                let mut schedule = self.schedule(Scheduling::Serial, 0);
                let outcome = self.docking(is_eager).run(&mut schedule);
                spent += schedule.expansions();
                match outcome {
                    Ok(()) => {
                        best = Some((schedule, Variant::Serial));
                        break;
                    }
                    Err(Stop::Failure(failure)) => {
                        failed.get_or_insert((schedule, failure));
                    }
                    Err(Stop::Budget) => {}
                }
            }
        }
        match (best, failed) {
            (Some((schedule, variant)), _) => Ok(Solution {
                schedule,
                variant,
                expansions: spent,
            }),
            (None, Some(failed)) => Err(Box::new(failed)),
            (None, None) => {
                debug_assert!(false, "the serial variant has no budget");
                let failure = Failure {
                    unit: 0,
                    in_the_way: None,
                };
                Err(Box::new((self.schedule(Scheduling::Serial, 0), failure)))
            }
        }
    }

    fn schedule(&self, timing: Scheduling, spent: u64) -> Schedule<'a> {
        let left = self.parameters.expansions_max.saturating_sub(spent);
        Schedule::new(self.arena, self.units, self.ready, timing, left)
    }

    fn docking(&self, is_eager: bool) -> Docking<'_> {
        Docking {
            filling: self.filling,
            target: self.target,
            is_eager,
        }
    }

    fn attempt(&self, variant: Variant, spent: u64) -> (Schedule<'a>, Result<(), Stop>) {
        let mut schedule = self.schedule(Scheduling::SafeIntervals, spent);
        let outcome = self.docking(variant == Variant::Eager).run(&mut schedule);
        if outcome.is_ok() {
            self.improve(&mut schedule);
        }
        (schedule, outcome)
    }

    fn improve(&self, schedule: &mut Schedule) {
        let passes = self.parameters.improvement_passes;
        // A plan that the budget leaves half improved is a plan.
        match improve(schedule, self.filling, passes) {
            Ok(()) | Err(Stop::Budget | Stop::Failure(_)) => {}
        }
    }
}
