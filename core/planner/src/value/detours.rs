//! How much longer than the straight way the way of a module to a spot is, because of walls.
//!
//! A detour is the number of steps from cell to cell past obstacles, walls, bodies and settled modules, less the number of steps
//! on the open field. A wall far away therefore changes nothing. Where settled modules alone bar the way, they can be
//! released and make way, so only what stays counts.

use formation_model::{CELL_UNREACHED, FreeCells, PlanningProblem, Policy, Target};

/// The most pairs of modules and spots of which detours are kept, and the most steps of all searches; beyond, ways count as
/// straight.
const PAIRS_MAX: usize = 1 << 24;
const STEPS_MAX: usize = 4_000_000_000;

/// The detours of all modules to all spots of a target, in whole units.
#[derive(Clone, Debug)]
pub(crate) struct Detours {
    spot_count: usize,
    steps: Vec<u16>,
}

impl Detours {
    /// The detours to the spots of `target`, a part of the problem's own; `None` if there are none, or under the policy `paper`,
    /// which knows straight ways only.
    pub(crate) fn of(problem: &PlanningProblem, target: &Target) -> Option<Self> {
        let whole = problem.target();
        let (modules, spots) = (problem.modules(), target.spots());
        if problem.parameters().policy == Policy::Paper {
            return None;
        }
        let cells = problem.free_cells()?;
        let searches = modules.len().min(spots.len());
        let is_too_much = modules.len().saturating_mul(spots.len()) > PAIRS_MAX
            || searches.saturating_mul(cells.count()) > STEPS_MAX;
        if is_too_much {
            return None;
        }
        let pins = modules.iter().filter_map(|module| module.pin);
        let settled: Vec<usize> = pins.filter_map(|pin| whole.position_of(pin)).collect();
        let positions = spots.iter().map(|spot| whole.position_of(spot.id));
        let goals: Vec<Option<usize>> = positions
            .map(|position| {
                let position = position.filter(|position| !settled.contains(position))?;
                cells.spots().get(position).copied()
            })
            .collect();
        let past_settled = cells.without(settled.into_iter());
        let mut table = Table {
            detours: vec![u32::MAX; modules.len() * spots.len()],
            starts: past_settled.starts(modules),
            goals,
        };
        table.fill(&past_settled);
        table.fill(&cells);
        let known = table.detours.iter().map(|&detour| {
            let detour = if detour == u32::MAX { 0 } else { detour };
            u16::try_from(detour).unwrap_or(u16::MAX)
        });
        let steps: Vec<u16> = known.collect();
        steps.iter().any(|&detour| detour > 0).then_some(Self {
            spot_count: spots.len(),
            steps,
        })
    }

    /// The detour of a module to a spot, in whole units.
    #[inline]
    pub(crate) fn units(&self, module: usize, spot: usize) -> i64 {
        i64::from(self.steps[module * self.spot_count + spot])
    }

    /// The longest detour.
    pub(crate) fn longest(&self) -> u64 {
        self.steps.iter().copied().max().unwrap_or_default().into()
    }
}

/// The detours while they are searched; [`u32::MAX`] where none is known.
struct Table {
    detours: Vec<u32>,
    /// The cell of each module that is to move.
    starts: Vec<Option<usize>>,
    /// The cell of each spot that is to be filled.
    goals: Vec<Option<usize>>,
}

impl Table {
    /// Enters the detours that are not known yet, from whichever are fewer, modules or spots.
    fn fill(&mut self, cells: &FreeCells) {
        let from_spots = self.goals.len() <= self.starts.len();
        let (sources, ends) = match from_spots {
            true => (self.goals.clone(), self.starts.clone()),
            false => (self.starts.clone(), self.goals.clone()),
        };
        let wanted: Vec<usize> = ends.iter().copied().flatten().collect();
        let (mut steps, mut queue) = (Vec::new(), Vec::new());
        for (source, from) in sources.iter().enumerate() {
            let Some(from) = *from else { continue };
            let place = |end: usize| match from_spots {
                true => end * self.goals.len() + source,
                false => source * self.goals.len() + end,
            };
            let is_open = |end: usize| ends[end].is_some() && self.detours[place(end)] == u32::MAX;
            if !(0..ends.len()).any(is_open) {
                continue;
            }
            cells.search(from, &wanted, &mut steps, &mut queue);
            for (end, to) in ends.iter().enumerate() {
                let Some(to) = *to else { continue };
                let at = place(end);
                if self.detours[at] == u32::MAX && steps[to] != CELL_UNREACHED {
                    self.detours[at] = steps[to].saturating_sub(cells.steps_in_the_open(from, to));
                }
            }
        }
    }
}
