//! Equal situations become equal states: what no longer matters is forgotten, and modules that are alike are sorted.

use super::rule::Rule;
use super::state::{MAX, Memory, Module, NEVER, Roster, Set, State, bit, contains, each};
use super::{Agreement, Search};

impl Agreement {
    pub fn canonical(&self, state: &mut State) {
        let live = self.leave_dead_rosters(state);
        if self.search == Search::Safety {
            state.moves = 0;
            if state.left.rosters == 0 {
                self.forget_what_only_rosters_need(state);
            }
        }
        for (index, module) in state.modules.iter_mut().enumerate() {
            self.forget(index, module);
        }
        let known = live | state.last.map_or(0, |last| 1 << last);
        let shown = state.modules.iter().filter_map(|module| module.run.last);
        let shown = shown.fold(0, |shown, roster| shown | 1 << roster);
        let tails = state.modules.iter().filter_map(|module| module.tail);
        let kept = tails.fold(known | shown, |kept, (roster, _)| kept | 1 << roster);
        rename(state, live, known, kept, shown);
        if self.sorts {
            self.sort(state);
        }
    }

    /// Whether nothing can happen any more that a property of safety could mind.
    pub fn is_over(&self, state: &State) -> bool {
        let last = state.last.map_or(0, |last| 1_u16 << last);
        let tails = state.modules.iter().filter_map(|module| module.tail);
        let rosters = state.modules.iter().filter_map(|module| module.roster);
        let mut open = rosters.chain(tails.map(|(roster, _)| roster));
        let is_last = open
            .all(|roster| last >> roster & 1 == 1 && state.rosters[usize::from(roster)].has_moved);
        self.search == Search::Safety && state.left.rosters == 0 && is_last
    }

    /// Whether no member of a roster can ever move by it again, or see it in force.
    fn is_dead(&self, state: &State, roster: u8) -> bool {
        let members = state.rosters[usize::from(roster)].members;
        let is_in = |module: usize| state.modules[module].roster == Some(roster);
        let may_be_heard = |module: usize| {
            let former = state.modules[module].former;
            is_in(module) || former.is_some_and(|(former, _)| former == roster)
        };
        !each(members).any(|module| {
            let this = &state.modules[module];
            // Before it is in force, an old heartbeat still counts for that.
            let limit = self.limit(state, module) + u8::from(this.agreed == NEVER);
            is_in(module)
                && each(members & !bit(module))
                    .all(|other| may_be_heard(other) || this.heard[other] <= limit)
        })
    }

    /// Returns the others.
    fn leave_dead_rosters(&self, state: &mut State) -> u8 {
        let mut live: u8 = 0;
        for module in 0..state.modules.len() {
            let Some(roster) = state.modules[module].roster else {
                continue;
            };
            if contains(live, usize::from(roster)) || !self.is_dead(state, roster) {
                live |= 1 << roster;
            }
        }
        let is_live = |roster: u8| contains(live, usize::from(roster));
        for module in &mut state.modules {
            if module.roster.is_some_and(|roster| !is_live(roster)) {
                module.leave();
            }
            module.former = module.former.filter(|&(roster, _)| is_live(roster));
        }
        live
    }

    /// What a module says of itself when a roster is formed no longer matters if none will be.
    fn forget_what_only_rosters_need(&self, state: &mut State) {
        let lists_removal = |module: &Module| {
            let roster = module.roster.filter(|_| !module.shows);
            roster.is_some_and(|roster| state.rosters[usize::from(roster)].removed != 0)
        };
        if self.tracks_listening() && state.modules.iter().any(lists_removal) {
            return;
        }
        for roster in &mut state.rosters {
            roster.removed = 0;
        }
        (state.commanded, state.named) = (0, 0);
        (
            state.left.removals,
            state.left.false_removals,
            state.left.blind,
        ) = (0, 0, 0);
        for module in &mut state.modules {
            module.memory = Memory::default();
            module.has_file = false;
            module.listened = [NEVER; MAX];
            (module.run.age, module.run.has_shown, module.run.has_vote) = (0, false, false);
            (module.run.last, module.run.others) = (None, 0);
            if module.roster.is_none() {
                (module.is_up, module.run.skew) = (true, 0);
            }
        }
    }

    fn forget(&self, index: usize, module: &mut Module) {
        let memory = &mut module.memory;
        if memory.proposed | memory.listed | memory.removed == 0 {
            memory.removal_age = 0;
        }
        let is_voter = contains(self.voters, index);
        memory.knows &= is_voter;
        if self.rule != Rule::ShortIdle {
            module.run.has_shown &= is_voter;
        }
        if module.run.has_shown || !is_voter {
            module.run.age = 0;
        }
        if !is_voter {
            (module.run.last, module.run.others) = (None, 0);
        }
    }

    /// The rule tells voters apart only by the lowest, and only where exactly half may suffice.
    fn class(&self, module: usize) -> u8 {
        let is_lowest = module == 0 && self.voters.count_ones().is_multiple_of(2);
        let flags = [
            contains(self.voters, module),
            is_lowest,
            contains(self.files, module),
        ];
        flags
            .iter()
            .fold(0, |flags, &flag| flags << 1 | u8::from(flag))
    }

    fn sort(&self, state: &mut State) {
        let mut order: Vec<usize> = (0..self.modules).collect();
        order.sort_by_cached_key(|&module| {
            (std::cmp::Reverse(self.class(module)), key(state, module))
        });
        // Classes keep their places, as they are in order from the beginning.
        if order.is_sorted() {
            return;
        }
        let set = |set: Set| {
            let places = order.iter().enumerate();
            let places = places.filter(|&(_, &module)| contains(set, module));
            places.fold(0, |set, (place, _)| set | bit(place))
        };
        let ages = |ages: [u8; MAX]| {
            let mut sorted = ages;
            for (place, &module) in order.iter().enumerate() {
                sorted[place] = ages[module];
            }
            sorted
        };
        let sort_module = |&module: &usize| {
            let mut module = state.modules[module];
            let memory = &mut module.memory;
            memory.removed = set(memory.removed);
            memory.listed = set(memory.listed);
            memory.proposed = set(memory.proposed);
            (module.heard, module.listened) = (ages(module.heard), ages(module.listened));
            module
        };
        let modules = order.iter().map(sort_module).collect();
        let mut down = 0;
        for (to, &old_to) in order.iter().enumerate() {
            for (from, &old_from) in order.iter().enumerate() {
                if !state.is_linked(old_from, old_to) {
                    down |= 1 << (to * MAX + from);
                }
            }
        }
        (state.modules, state.down) = (modules, down);
        state.slow = set(state.slow);
        (state.commanded, state.named) = (set(state.commanded), set(state.named));
        for roster in &mut state.rosters {
            (roster.members, roster.removed) = (set(roster.members), set(roster.removed));
        }
    }
}

/// What tells a module apart, whatever the others are called.
fn key(state: &State, module: usize) -> [u8; 26] {
    let this = &state.modules[module];
    let mut key = [0; 26];
    let flags = [
        this.is_up,
        this.has_file,
        this.shows,
        this.run.has_shown,
        this.run.has_vote,
        this.memory.knows,
        contains(state.commanded, module),
        contains(state.named, module),
    ];
    key[0] = flags
        .iter()
        .fold(0, |flags, &flag| flags << 1 | u8::from(flag));
    let is_slow = u8::from(contains(state.slow, module));
    (key[1], key[2], key[3]) = (this.roster.unwrap_or(NEVER), this.agreed, this.run.age);
    (key[4], key[5]) = this.tail.unwrap_or_default();
    (key[6], key[7]) = this.former.unwrap_or_default();
    (key[8], key[9], key[10]) = (
        this.run.skew << 1 | is_slow,
        this.memory.plans,
        this.memory.removal_age,
    );
    let memory = &this.memory;
    for (place, removals) in (11..).zip([memory.proposed, memory.listed, memory.removed]) {
        key[place] = count(removals);
    }
    let mut heard = this.heard;
    heard.sort_unstable();
    key[14..14 + MAX].copy_from_slice(&heard);
    key[24] = this.run.last.unwrap_or(NEVER);
    key[25] = this.run.others;
    for (place, roster) in (14 + MAX..24).zip(&state.rosters) {
        let lists = [roster.members, roster.removed].map(|set| u8::from(contains(set, module)));
        key[place] = lists[0] << 1 | lists[1];
    }
    key
}

fn count(set: Set) -> u8 {
    (0..8).fold(0, |count, element| count + (set >> element & 1))
}

/// Keeps these rosters, in order; only live ones keep what they list, and those that were shown last their members.
fn rename(state: &mut State, live: u8, known: u8, kept: u8, shown: u8) {
    let name = |roster: u8| count(kept & (bit(usize::from(roster)) - 1));
    let names = |plans: u8| {
        let plans = (0..8).filter(|&roster| plans & known & 1 << roster != 0);
        plans.fold(0, |names, roster| names | 1 << name(roster))
    };
    let rosters = std::mem::take(&mut state.rosters)
        .into_iter()
        .zip(0_usize..);
    for (mut roster, index) in rosters.filter(|&(_, index)| contains(kept, index)) {
        roster.plans = names(roster.plans);
        let is_live = contains(live, index);
        let is_last = state.last.is_some_and(|last| usize::from(last) == index);
        let may_be_judged = is_last && live & (bit(index) - 1) != 0;
        let members = roster.members & if contains(shown, index) { Set::MAX } else { 0 };
        state.rosters.push(match roster {
            roster if is_live => roster,
            Roster {
                plans, is_whole, ..
            } if may_be_judged => Roster {
                plans,
                is_whole,
                members,
                ..Roster::default()
            },
            _ => Roster {
                members,
                ..Roster::default()
            },
        });
    }
    for module in &mut state.modules {
        module.memory.plans = names(module.memory.plans);
        module.roster = module.roster.map(name);
        module.run.last = module.run.last.map(name);
        module.tail = module.tail.map(|(roster, ticks)| (name(roster), ticks));
        module.former = module.former.map(|(roster, age)| (name(roster), age));
    }
    state.last = state.last.map(name);
}
