//! Which modules may form a roster, and when it may move: rules 1 to 6, and their mutants.

use super::Agreement;
use super::state::{NEVER, Roster, Run, Set, State, bit, contains, each};

/// The rule that a model follows: the one that holds, or one that differs from it in one point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The rule of the page with these corrections. The waits of rules 2 and 3 include how late a drive stops, and rule 3 has
    /// the margins of rule 2. A removal first counts in a roster that has a majority without it or holds all voters that
    /// remain; once that is in force, majorities count the remaining voters. A later run of a removed module has no vote, and
    /// knows it. A resume file says whether its run knew, and a run without one does not know. Any sleep that the margins do
    /// not cover makes a module halt and begin a new run.
    Right,

    /// The first motion does not wait after agreement.
    NoLease,
    /// Any set of modules may form.
    NoMajority,
    /// Rule 3 in its shorter form: nobody waits if no member was in an epoch with a plan.
    ShortIdle,
    /// A receiver takes the delay of late heartbeats for a step of the sender's clock.
    Rebase,
    /// Agents accept removals that name no run.
    BlindRemovals,
    /// A removal counts in the roster that lists it, and exactly half suffices then as well.
    TiesAfterRemoval,
    /// A majority counts those that know nothing as well.
    IgnorantMajority,
    /// The lease has no margins for clocks and delays.
    NoMargins,
    /// Rule 3 without its clause about removals.
    IdleDespiteRemoval,
    /// Rule 3 for a roster that leaves out members of the last plan.
    LastPlanOfOthers,
    /// Rule 3 without the plans that were shown before the last one.
    OtherPlansForgotten,
    /// A module that learns that it slept does not halt.
    GoesOnAfterSleep,
    /// A run that finds no file counts as one that knows. A file restored from a backup has the same effect.
    EmptyFileKnows,

    /// As on the page: a drive may stop late, and the wait of rule 2 leaves that out.
    DriveLeftOut,
    /// As on the page: rule 3 compares with `lease_s` without margins.
    IdleWithoutMargins,
    /// As on the page: a removal counts in the roster that lists it.
    RemovalCountsAtOnce,
    /// A later run of a module whose vote was removed has a vote for those that do not know of the removal.
    LaterRunVotes,
    /// As the page can be read: both of these.
    PageRemovals,
    /// As on the page, read literally: a run knows if it finds any resume file.
    AnyFileKnows,
    /// As on the page: a short sleep (up to `heartbeat_s`, here one tick), which the margins do not cover, has no effect.
    ShortSleepsPass,
    /// The same, with a wait that covers one such sleep.
    ShortSleepsCovered,

    /// It holds as well: a heartbeat that shows a sleep adds it to the age of all that was heard before, and that is all.
    SleepAges,
    /// It holds as well: a later run of a removed module has a vote, but begins without a file, so it does not know.
    LaterRunForgets,
    /// It holds as well: once removals are in force, exactly half of the voters that remain suffices with the lowest of them.
    TiesInForce,
    /// Exactly half never suffices.
    NoTies,
}

/// What a set of modules would be as a roster.
struct Count {
    removed: Set,
    is_whole: bool,
}

impl Agreement {
    /// Ticks for which A1 accepts a heartbeat: longer on a slow clock.
    pub fn limit(&self, state: &State, module: usize) -> u8 {
        let is_slow = !self.has_speeds || contains(state.slow, module);
        self.times.lease + if is_slow { self.times.margin } else { 0 }
    }

    /// Ticks from agreement to the first motion: shorter on a fast clock.
    pub fn wait(&self, state: &State, module: usize) -> u8 {
        let is_slow = self.has_speeds && contains(state.slow, module);
        self.shortest_wait() + if is_slow { self.times.margin } else { 0 }
    }

    pub fn longest_wait(&self) -> u8 {
        self.shortest_wait()
            + if self.has_speeds {
                self.times.margin
            } else {
                0
            }
    }

    fn shortest_wait(&self) -> u8 {
        let times = &self.times;
        match self.rule {
            Rule::NoLease => 0,
            Rule::NoMargins => times.lease + times.stop,
            Rule::DriveLeftOut => times.lease + times.margin + 1,
            Rule::ShortSleepsCovered => self.full_wait() + 1,
            _ => self.full_wait(),
        }
    }

    /// Longer than anything that was in motion before can still be.
    fn full_wait(&self) -> u8 {
        self.times.lease + self.times.margin + self.times.stop + 1
    }

    /// How old runs and removals must be for rule 3.
    pub fn idle_wait(&self) -> u8 {
        match self.rule {
            Rule::IdleWithoutMargins => self.times.lease,
            _ => self.full_wait(),
        }
    }

    /// The removals that these modules would list in addition to those that they know: no member heard the run for
    /// `suspicion_s`, and each has listened for as long.
    fn due(&self, state: &State, set: Set, known: Set) -> Set {
        let proposed = each(set).fold(0, |all, module| all | state.modules[module].memory.proposed);
        let due = each(proposed & !known).filter(|&removed| {
            !contains(set & state.named, removed)
                && each(set)
                    .all(|module| state.modules[module].listened[removed] >= self.times.suspicion)
        });
        due.fold(0, |all, removed| all | bit(removed))
    }

    fn count(&self, state: &State, set: Set) -> Option<Count> {
        let memories = || each(set).map(|module| state.modules[module].memory);
        let in_force = memories().fold(0, |all, memory| all | memory.removed);
        let known = memories().fold(in_force, |all, memory| all | memory.listed);
        let removed = known | self.due(state, set, known);
        if set & removed & state.named != 0 {
            return None;
        }
        let votes = each(set & self.voters & !removed)
            .filter(|&module| state.modules[module].run.has_vote)
            .fold(0, |votes, module| votes | bit(module));
        let remaining = self.voters & !removed;
        let is_whole = remaining != 0 && remaining & !votes == 0;
        let base = match self.rule {
            Rule::RemovalCountsAtOnce | Rule::PageRemovals | Rule::TiesAfterRemoval => remaining,
            _ => self.voters & !in_force,
        };
        let knows = |module: usize| {
            self.rule == Rule::IgnorantMajority || state.modules[module].memory.knows
        };
        let knowing = each(votes).filter(|&module| knows(module));
        let knowing = knowing.fold(0, |all, module| all | bit(module));
        let may_tie = match self.rule {
            Rule::TiesAfterRemoval | Rule::TiesInForce => true,
            Rule::RemovalCountsAtOnce | Rule::PageRemovals => removed == 0,
            Rule::NoTies => false,
            _ => in_force == 0,
        };
        let is_majority = is_majority(knowing & base, base, may_tie);
        (is_whole || is_majority || self.rule == Rule::NoMajority)
            .then_some(Count { removed, is_whole })
    }

    /// The roster that these modules would have, if the rule lets them form.
    pub fn roster(&self, state: &State, set: Set) -> Option<Roster> {
        let count = self.count(state, set)?;
        let modules = || each(set).map(|module| &state.modules[module]);
        let plans = modules().fold(0, |plans, module| plans | module.memory.plans);
        let idle = self.idle(state, set, &count);
        Some(Roster {
            members: set,
            removed: count.removed,
            is_whole: count.is_whole,
            plans,
            age: 0,
            idle,
            has_moved: false,
        })
    }

    /// Ticks until a roster may move without waiting for the lease (rule 3).
    fn idle(&self, state: &State, set: Set, count: &Count) -> u8 {
        let modules = || each(set).map(|module| &state.modules[module]);
        if self.rule == Rule::ShortIdle {
            let has_plan = modules().any(|module| module.run.has_shown);
            return if has_plan { NEVER } else { 0 };
        }
        if self.follows_last_plan(state, set, count) {
            return 0;
        }
        let mut voters = each(set & self.voters & !count.removed);
        if !count.is_whole || voters.any(|module| state.modules[module].run.has_shown) {
            return NEVER;
        }
        let need = self.idle_wait();
        let voters = each(set & self.voters & !count.removed);
        let runs = voters.map(|module| need - state.modules[module].run.age.min(need));
        let removals = each(count.removed).map(|removed| {
            let knowing = modules().filter(|module| {
                let memory = module.memory;
                contains(memory.proposed | memory.listed | memory.removed, removed)
            });
            let oldest = knowing.map(|module| module.memory.removal_age).max();
            need - oldest.unwrap_or(0).min(need)
        });
        let runs = runs.max().unwrap_or(0);
        if self.rule == Rule::IdleDespiteRemoval {
            return runs;
        }
        runs.max(removals.max().unwrap_or(0))
    }
}

impl Agreement {
    /// Whether all that moved last is in this roster: each voter is idle, or can have shown no plan within the lease but the same last
    /// one, whose members are members of this roster.
    fn follows_last_plan(&self, state: &State, set: Set, count: &Count) -> bool {
        let runs = || each(set & self.voters).map(|module| &state.modules[module].run);
        let Some(last) = runs().find_map(|run| run.last) else {
            return false;
        };
        let is_idle = |run: &Run| !run.has_shown && run.age >= self.idle_wait();
        let is_followed = |run: &Run| run.last == Some(last) && run.others == 0;
        let outside = state.rosters[usize::from(last)].members & !set;
        count.is_whole
            && count.removed == 0
            && (outside == 0 || self.rule == Rule::LastPlanOfOthers)
            && runs().all(|run| is_idle(run) || is_followed(run))
    }
}

/// More than half of a base, or exactly half with its lowest module where ties count.
fn is_majority(votes: Set, base: Set, may_tie: bool) -> bool {
    let lowest = base & base.wrapping_neg();
    let (count, all) = (votes.count_ones() * 2, base.count_ones());
    base != 0 && (count > all || (may_tie && count == all && votes & lowest != 0))
}
