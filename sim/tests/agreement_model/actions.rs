//! What may happen in a state, and what it changes.

use super::rule::Rule;
use super::state::{MAX, Set, State, bit, contains, each};
use super::{Agreement, Network};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Tick,
    /// A tick during which this module sleeps.
    Sleep(usize),
    /// These modules have frozen, and get a roster.
    Open(Set),
    /// A member shows the digest, or all do.
    Show(usize),
    /// A heartbeat arrives.
    Deliver {
        from: usize,
        to: usize,
    },
    /// One arrives that its sender sent before it left its former roster.
    DeliverLate {
        from: usize,
        to: usize,
    },
    Crash(usize),
    /// The resume file is lost as well.
    CrashAndLose(usize),
    Restart(usize),
    /// A process begins a new run.
    Rejoin(usize),
    /// A command removes the present or last run of this module, with its vote.
    Remove(usize),
    /// All such commands reach this module.
    Learn(usize),
    /// A command that names no run reaches everyone.
    Blind,
    /// These links are down, all others are up.
    Links(u32),
}

impl Agreement {
    /// What may happen to one module.
    pub fn module_actions(&self, state: &State, index: usize, actions: &mut Vec<Action>) {
        let module = &state.modules[index];
        let left = &state.left;
        let may_be_false = left.false_removals > 0 || !module.is_up;
        if left.removals > 0
            && !contains(state.commanded, index)
            && may_be_false
            && contains(self.voters, index)
        {
            actions.push(Action::Remove(index));
        }
        if !module.is_up {
            actions.push(Action::Restart(index));
            return;
        }
        if left.crashes > 0 && (left.rosters > 0 || module.roster.is_some()) {
            actions.push(Action::Crash(index));
            if left.losses > 0 && module.has_file {
                actions.push(Action::CrashAndLose(index));
            }
        }
        if left.rejoins > 0 && left.rosters > 0 {
            actions.push(Action::Rejoin(index));
        }
        if module.roster.is_some() && !module.shows && self.may_show(state, index) {
            actions.push(Action::Show(index));
        }
        if left.sleeps > 0 {
            actions.push(Action::Sleep(index));
        }
        let memory = &module.memory;
        let told = memory.proposed | memory.listed | memory.removed;
        if state.commanded & !told & !(state.named & bit(index)) != 0 {
            actions.push(Action::Learn(index));
        }
    }

    /// Whether a member may show the digest: the lowest for all, if they do it at once.
    fn may_show(&self, state: &State, index: usize) -> bool {
        if self.one_by_one {
            return self.accepts(state, index);
        }
        let roster = state.modules[index].roster;
        let members = state.roster_of(index).map_or(0, |roster| roster.members);
        let is_in = |member: usize| state.modules[member].roster == roster;
        each(members).all(|member| is_in(member) && self.accepts(state, member) && member >= index)
    }

    /// A member that heard a run of late does not accept its removal.
    fn accepts(&self, state: &State, index: usize) -> bool {
        let memory = &state.modules[index].memory;
        let Some(roster) = state.roster_of(index) else {
            return false;
        };
        let new = roster.removed & !memory.removed & !memory.listed;
        each(new).all(|removed| state.modules[index].listened[removed] >= self.times.suspicion)
    }

    /// The sets of modules that may form a roster.
    pub fn open_actions(&self, state: &State, actions: &mut Vec<Action>) {
        let ready = (0..self.modules).filter(|&module| {
            let module = &state.modules[module];
            module.is_up && module.tail.is_none() && module.run.skew == 0
        });
        let ready = ready.fold(0, |all, module| all | bit(module));
        let receive_each_other = |set: Set| {
            each(set).all(|to| each(set & !bit(to)).all(|from| state.is_linked(from, to)))
        };
        let sets = (1..=ready).filter(|set| set & !ready == 0);
        let sets = sets.filter(|&set| receive_each_other(set) && self.roster(state, set).is_some());
        actions.extend(sets.map(Action::Open));
    }

    /// Heartbeats that may arrive, or links that may change.
    pub fn network_actions(&self, state: &State, actions: &mut Vec<Action>) {
        if self.network == Network::Links {
            if state.left.link_changes > 0 {
                let patterns = link_patterns(self.modules).into_iter();
                actions.extend(
                    patterns
                        .filter(|&down| down != state.down)
                        .map(Action::Links),
                );
            }
            return;
        }
        for to in 0..self.modules {
            for from in (0..self.modules).filter(|&from| from != to) {
                if self.is_news(state, from, to) {
                    actions.push(Action::Deliver { from, to });
                }
                let (receiver, former) = (&state.modules[to], state.modules[from].former);
                let is_late = former.is_some_and(|(roster, age)| {
                    receiver.roster == Some(roster) && receiver.heard[from] > age
                });
                if is_late && receiver.is_up && receiver.run.skew == 0 {
                    actions.push(Action::DeliverLate { from, to });
                }
            }
        }
    }

    /// All members have frozen, so each stands and shows no other roster; the convener publishes theirs.
    fn open(&self, state: &mut State, set: Set) -> Option<()> {
        let roster = self.roster(state, set)?;
        let name = u8::try_from(state.rosters.len()).unwrap();
        state.rosters.push(roster);
        for module in each(set) {
            let module = &mut state.modules[module];
            self.withdraw(module);
            module.roster = Some(name);
        }
        state.left.rosters -= 1;
        Some(())
    }

    /// A member has computed the plan and shows its digest.
    fn show(&self, state: &mut State, index: usize) {
        let Some(roster) = state.roster_of(index).copied() else {
            return;
        };
        let name = state.modules[index].roster.unwrap_or_default();
        let outside = |last: u8| state.rosters[usize::from(last)].members & !roster.members;
        let last = state.modules[index].run.last.filter(|&last| last != name);
        let may_leave_others = last.is_some_and(|last| outside(last) != 0);
        let module = &mut state.modules[index];
        (module.shows, module.run.has_shown) = (true, true);
        module.run.last = Some(name);
        if may_leave_others && self.rule != Rule::OtherPlansForgotten {
            module.run.others = self.idle_wait();
        }
        module.memory.plans |= roster.plans | 1 << name;
        module.memory.listed |= roster.removed;
        self.see_agreement(state, index);
    }

    /// Changes a state; `None` if the action changes nothing.
    pub fn apply(&self, state: &mut State, action: Action) -> Option<()> {
        match action {
            Action::Tick => self.tick(state, None),
            Action::Sleep(module) => {
                state.left.sleeps -= 1;
                self.tick(state, Some(module));
            }
            Action::Open(set) => self.open(state, set)?,
            Action::Show(module) if self.one_by_one => self.show(state, module),
            Action::Show(module) => {
                let members = state.roster_of(module)?.members;
                each(members).for_each(|member| self.show(state, member));
            }
            Action::Deliver { from, to } => self.deliver(state, from, to),
            Action::DeliverLate { from, to } => self.deliver_late(state, from, to),
            Action::Crash(module) => {
                state.left.crashes -= 1;
                self.crash(state, module, false);
            }
            Action::CrashAndLose(module) => {
                state.left.crashes -= 1;
                state.left.losses -= 1;
                self.crash(state, module, true);
            }
            Action::Restart(module) => self.restart(state, module),
            Action::Rejoin(module) => {
                state.left.rejoins -= 1;
                self.rejoin(state, module);
            }
            Action::Remove(module) => {
                state.left.removals -= 1;
                state.left.false_removals -= u8::from(state.modules[module].is_up);
                state.commanded |= bit(module);
                state.named |= bit(module);
            }
            Action::Learn(module) => {
                let own = state.named & bit(module);
                let memory = &mut state.modules[module].memory;
                memory.proposed |= state.commanded & !memory.removed & !memory.listed & !own;
                memory.removal_age = 0;
            }
            Action::Blind => self.command_blindly(state),
            Action::Links(down) => {
                state.left.link_changes -= 1;
                state.down = down;
            }
        }
        Some(())
    }

    /// A command removes all modules that are silent, without naming a run. Agents refuse it.
    fn command_blindly(&self, state: &mut State) {
        state.left.blind -= 1;
        if self.rule != Rule::BlindRemovals {
            return;
        }
        state.commanded |= self.voters;
        state.named |= self.voters;
        for index in 0..self.modules {
            let memory = &mut state.modules[index].memory;
            memory.proposed |= self.voters & !bit(index);
            memory.removal_age = 0;
        }
    }
}

/// All links up; two groups that do not hear each other, or one that does not hear the other; one link down.
fn link_patterns(modules: usize) -> Vec<u32> {
    let all: Set = (1 << modules) - 1;
    let deaf = |to: Set, from: Set| {
        let pairs = each(to).flat_map(move |to| each(from).map(move |from| (to, from)));
        pairs.fold(0_u32, |down, (to, from)| down | 1 << (to * MAX + from))
    };
    let mut patterns = vec![0];
    for group in 1..all {
        patterns.push(deaf(group, all & !group));
        if contains(group, 0) {
            patterns.push(deaf(group, all & !group) | deaf(all & !group, group));
        }
        for from in each(group).filter(|_| group.count_ones() == 1) {
            patterns.extend(each(all & !group).map(|to| deaf(bit(to), bit(from))));
        }
    }
    patterns.sort_unstable();
    patterns.dedup();
    patterns
}
