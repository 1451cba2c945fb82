//! How time passes, who hears whom, and who moves: A1, A2 and rule 7.

use super::rule::Rule;
use super::state::{MAX, Module, NEVER, Run, State, bit, contains, each};
use super::{Agreement, LeaseFrom, Network};

impl Agreement {
    /// The roster by which a module may have a goal now. It is taken to have one whenever it may.
    pub fn goal(&self, state: &State, module: usize) -> Option<u8> {
        let this = &state.modules[module];
        let roster = state.roster_of(module)?;
        if !this.is_up || !this.shows || this.agreed == NEVER {
            return None;
        }
        let others = roster.members & !bit(module);
        let is_fresh = each(others).all(|other| this.heard[other] <= self.limit(state, module));
        (is_fresh && (self.has_waited(state, module) || roster.idle == 0))
            .then_some(this.roster)
            .flatten()
    }

    /// Whether the lease of A2 is over.
    pub fn has_waited(&self, state: &State, module: usize) -> bool {
        let since = match self.lease_from {
            LeaseFrom::Agreement => state.modules[module].agreed,
            LeaseFrom::Roster => state.roster_of(module).map_or(0, |roster| roster.age),
        };
        since >= self.wait(state, module)
    }

    /// The rosters by which modules have goals. A module that slept is left out until it hears a heartbeat (rule 7).
    pub fn goals(&self, state: &State) -> u8 {
        (0..state.modules.len())
            .filter(|&module| state.modules[module].run.skew == 0)
            .filter_map(|module| self.goal(state, module))
            .fold(0, |rosters, roster| rosters | 1 << roster)
    }

    /// The rosters by which drives are in motion.
    pub fn motion(&self, state: &State) -> u8 {
        let tails = state.modules.iter().filter_map(|module| module.tail);
        tails.fold(self.goals(state), |rosters, (roster, _)| {
            rosters | 1 << roster
        })
    }

    /// One tick, during which one module may sleep: nothing ages for it.
    pub fn tick(&self, state: &mut State, asleep: Option<usize>) {
        let modules = state.modules.len();
        let goals: Vec<_> = (0..modules)
            .map(|module| self.goal(state, module))
            .collect();
        for roster in &mut state.rosters {
            if roster.idle != NEVER {
                roster.idle = roster.idle.saturating_sub(1);
            }
            if self.lease_from == LeaseFrom::Roster && roster.members != 0 {
                roster.age = (roster.age + 1).min(self.longest_wait());
            }
        }
        let limits: Vec<_> = (0..modules)
            .map(|module| self.limit(state, module))
            .collect();
        for (index, module) in state.modules.iter_mut().enumerate() {
            module.tail = module
                .tail
                .and_then(|(roster, ticks)| (ticks > 1).then_some((roster, ticks - 1)));
            module.former = module
                .former
                .and_then(|(roster, age)| (age < self.times.delay).then_some((roster, age + 1)));
            if asleep == Some(index) {
                module.run.skew += 1;
            } else if module.is_up {
                self.age(module, limits[index] + 1);
            }
        }
        for (module, goal) in goals.into_iter().enumerate() {
            let counts = self.times.stop > 0 && state.modules[module].run.skew == 0;
            let Some(roster) = goal.filter(|_| counts) else {
                continue;
            };
            if self.goal(state, module) != Some(roster) {
                state.modules[module].tail = Some((roster, self.times.stop));
            }
        }
    }

    /// All ages of a module grow by a tick. Those that no longer matter are equal.
    fn age(&self, module: &mut Module, stale: u8) {
        add_age(module, 1, stale);
        if self.tracks_listening() {
            for age in module.listened.iter_mut().filter(|age| **age != NEVER) {
                *age = (*age + 1).min(self.times.suspicion);
            }
        }
        if module.agreed != NEVER && self.lease_from == LeaseFrom::Agreement {
            module.agreed = (module.agreed + 1).min(self.longest_wait());
        }
        module.run.age = (module.run.age + 1).min(self.idle_wait());
        module.run.others = module.run.others.saturating_sub(1);
        module.memory.removal_age = (module.memory.removal_age + 1).min(self.idle_wait());
    }

    pub fn tracks_listening(&self) -> bool {
        self.budget.false_removals > 0 || self.budget.blind > 0
    }

    /// Whether a heartbeat would change anything at its receiver.
    pub fn is_news(&self, state: &State, from: usize, to: usize) -> bool {
        let (sender, receiver) = (&state.modules[from], &state.modules[to]);
        let is_member = receiver.roster.is_some() && sender.roster == receiver.roster;
        sender.is_up
            && receiver.is_up
            && ((is_member && sender.shows && receiver.heard[from] != 0)
                || (self.tracks_listening() && !matches!(receiver.listened[from], 0 | NEVER))
                || receiver.run.skew != 0)
    }

    /// A heartbeat of `from` reaches `to`.
    pub fn deliver(&self, state: &mut State, from: usize, to: usize) {
        let sender = state.modules[from];
        // A later run than the one that a removal names says nothing about that one.
        let is_named = contains(state.named, from) || !contains(state.commanded, from);
        let stale = self.limit(state, to) + 1;
        let receiver = &mut state.modules[to];
        self.notice_sleep(receiver, stale);
        if is_named && self.tracks_listening() && receiver.listened[from] != NEVER {
            receiver.listened[from] = 0;
            receiver.memory.proposed &= !bit(from);
        }
        if receiver.roster.is_some() && sender.roster == receiver.roster && sender.shows {
            receiver.heard[from] = 0;
        }
        self.see_agreement(state, to);
    }

    /// A heartbeat that `from` sent before it left its former roster reaches `to`.
    pub fn deliver_late(&self, state: &mut State, from: usize, to: usize) {
        let Some((_, age)) = state.modules[from].former else {
            return;
        };
        let heard = &mut state.modules[to].heard[from];
        let judged = if self.rule == Rule::Rebase { 0 } else { age };
        *heard = judged.min(*heard);
        self.see_agreement(state, to);
    }

    /// A heartbeat shows that the receiver's clock stood still (rule 7).
    fn notice_sleep(&self, module: &mut Module, stale: u8) {
        let skew = std::mem::take(&mut module.run.skew);
        if self.rule == Rule::SleepAges {
            add_age(module, skew, stale);
            return;
        }
        let passes = match self.rule {
            Rule::GoesOnAfterSleep => true,
            Rule::ShortSleepsPass | Rule::ShortSleepsCovered => skew <= 1,
            _ => skew == 0,
        };
        if !passes && module.roster.is_some() {
            self.withdraw(module);
            module.run = module.run.next(self.idle_wait());
        }
    }

    /// A process begins a new run, as after its addresses changed: its drive halts, and it knows what it showed.
    pub fn rejoin(&self, state: &mut State, module: usize) {
        let tail = self.tail(state, module);
        let this = &mut state.modules[module];
        self.withdraw(this);
        (this.tail, this.run) = (tail, this.run.next(self.idle_wait()));
    }

    /// What is left of the motion of a drive whose goal is withdrawn.
    fn tail(&self, state: &State, module: usize) -> Option<(u8, u8)> {
        let this = &state.modules[module];
        let counts = self.times.stop > 0 && this.run.skew == 0;
        let goal = self.goal(state, module).filter(|_| counts);
        goal.map(|roster| (roster, self.times.stop + 1))
            .or(this.tail)
    }

    /// A module that shows a digest notes whether it has seen all others show it.
    pub fn see_agreement(&self, state: &mut State, module: usize) {
        let Some(roster) = state.roster_of(module).copied() else {
            return;
        };
        let this = &mut state.modules[module];
        let mut others = each(roster.members & !bit(module));
        if this.shows && this.agreed == NEVER && others.all(|other| this.heard[other] != NEVER) {
            this.agreed = 0;
            this.memory.knows = true;
            this.memory.removed |= roster.removed;
        }
    }

    /// A module stops showing its roster; its heartbeats may still be on their way.
    pub fn withdraw(&self, module: &mut Module) {
        if module.shows && self.times.delay > 0 {
            module.former = module.roster.map(|roster| (roster, 0));
        }
        module.leave();
    }

    pub fn crash(&self, state: &mut State, module: usize, loses_file: bool) {
        let tail = self.tail(state, module);
        let this = &mut state.modules[module];
        self.withdraw(this);
        (this.is_up, this.tail) = (false, tail);
        this.listened = [0; MAX];
        this.run = Run::forgetful(self.idle_wait());
        this.has_file &= !loses_file;
        if !this.has_file {
            this.memory = super::Memory::default();
        }
    }

    pub fn restart(&self, state: &mut State, module: usize) {
        state.named &= !bit(module);
        let this = &mut state.modules[module];
        this.is_up = true;
        let is_removed = contains(state.commanded, module);
        this.run.has_vote = !is_removed
            || matches!(
                self.rule,
                Rule::LaterRunVotes | Rule::LaterRunForgets | Rule::PageRemovals
            );
        match self.rule {
            Rule::LaterRunForgets if is_removed => this.memory = super::Memory::default(),
            Rule::AnyFileKnows => this.memory.knows |= this.has_file,
            Rule::EmptyFileKnows => this.memory.knows = true,
            _ => {}
        }
        this.has_file = contains(self.files, module);
        if !self.tracks_listening() {
            this.listened = [self.times.suspicion; MAX];
        }
    }

    /// Heartbeats pass over all links that are up, where links are part of the state.
    pub fn pass_heartbeats(&self, state: &mut State) {
        if self.network != Network::Links {
            return;
        }
        let modules = state.modules.len();
        for to in 0..modules {
            for from in (0..modules).filter(|&from| from != to) {
                if state.is_linked(from, to) && self.is_news(state, from, to) {
                    self.deliver(state, from, to);
                }
            }
        }
    }

    /// Notes which rosters moved, and whether the later of two knew the bodies of the earlier. All voters together need not
    /// know: once they are a roster in force, its bodies are those to know.
    pub fn note_motion(&self, state: &mut State) {
        let goals = self.goals(state);
        for index in 0..state.rosters.len() {
            let in_force = state.modules.iter().any(|module| {
                module
                    .roster
                    .is_some_and(|roster| usize::from(roster) == index)
                    && module.agreed != NEVER
            });
            let roster = &mut state.rosters[index];
            let moves = contains(goals, index);
            let moves_first = moves && !roster.has_moved;
            roster.has_moved |= moves;
            let counts = moves || (in_force && roster.is_whole);
            let last = state.last.map(usize::from).filter(|&last| last != index);
            if moves_first {
                let has_crashed = state.left.crashes < self.budget.crashes;
                state.moves = match state.moves {
                    0 => 1,
                    _ if has_crashed => 3,
                    moves => moves.max(2),
                };
                if let Some(last) = last {
                    let (earlier, later) = (last.min(index), last.max(index));
                    let later = &state.rosters[later];
                    state.is_ignorant |= !later.is_whole && !contains(later.plans, earlier);
                }
            }
            if counts && last.is_none_or(|last| last < index) {
                state.last = u8::try_from(index).ok();
            }
        }
    }
}

/// All heartbeats that a module heard are so many ticks older. One that is too old to move on is as good as none.
fn add_age(module: &mut Module, ticks: u8, stale: u8) {
    for age in module.heard.iter_mut().filter(|age| **age != NEVER) {
        *age = (*age + ticks).min(stale);
        if *age == stale && module.agreed != NEVER {
            *age = NEVER;
        }
    }
}
