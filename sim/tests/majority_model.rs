//! The rule of majorities alone, checked exhaustively: modules crash, restart and retire, and form wherever the rule allows.
//!
//! A formation may continue as long as none of its members has left it, so at no time may two formations exist side by side.
//! The model knows nothing of messages: whatever set of running modules the rule admits may form at any time, which covers
//! every cut and every order of messages. What a module knows is the last roster that it saw agreed and the later ones for
//! which a member showed a digest; it shares that with the members of its next roster.

use stateright::{Checker, Model, Property};

/// A set of modules, one bit each.
type Set = u8;

fn contains(set: Set, module: usize) -> bool {
    set >> module & 1 == 1
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Roster {
    members: Set,
    /// The active members, which count.
    voters: Set,
    /// Those of them that still remember.
    remembered: Set,
    /// The members that showed the digest.
    showed: Set,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct Module {
    is_up: bool,
    is_retired: bool,
    agreed: Option<u8>,
    /// The rosters that it knows to be shown, one bit each.
    shown: u16,
    /// The roster that it holds, and whether it has shown the digest.
    holds: Option<(u8, bool)>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct State {
    modules: Vec<Module>,
    rosters: Vec<Roster>,
    forms_left: u8,
    crashes_left: u8,
    retires_left: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Crash(usize),
    Restart(usize),
    Retire(usize),
    /// These modules get a roster of their own.
    Form(Set),
    Show(usize),
    Agree(usize),
}

/// Which sets of modules may form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    /// A majority of each basis, or all of its members back; a majority of the expected number at first.
    AllBack,
    /// The rules Q1 to Q4 and Q7.
    Memories,
    /// `Memories` without Q7.
    WithoutFounder,
    /// `Memories`, except that a roster that was shown replaces the founders.
    ShownReplacesFounders,
}

struct Majorities {
    modules: usize,
    founders: Set,
    /// The modules with stores.
    stores: Set,
    rule: Rule,
    forms: u8,
    crashes: u8,
    retires: u8,
    /// Whether members show digests and agree one by one, so that a crash may come in between.
    one_by_one: bool,
}

impl Majorities {
    /// What a set of modules knows together: the last agreed roster, and the later ones that were shown.
    fn known(state: &State, set: Set) -> (Option<u8>, u16) {
        let modules = state.modules.iter().enumerate();
        let present = modules.filter(|&(index, _)| contains(set, index));
        let (agreed, shown) = present.fold((None, 0), |(agreed, shown), (_, module)| {
            (module.agreed.max(agreed), shown | module.shown)
        });
        (agreed, shown & !agreed.map_or(0, up_to))
    }

    fn has_majority(&self, state: &State, set: Set, basis: u8) -> bool {
        let roster = &state.rosters[usize::from(basis)];
        let present = set & roster.voters & roster.remembered;
        let lowest = roster.voters & roster.voters.wrapping_neg();
        let (count, all) = (present.count_ones() * 2, roster.voters.count_ones());
        let all_back = roster.voters != 0 && roster.voters & !set == 0;
        count > all
            || (count == all && present & lowest != 0)
            || (self.rule == Rule::AllBack && all_back)
    }

    fn may_form(&self, state: &State, set: Set) -> bool {
        let (agreed, shown) = Self::known(state, set);
        let mut bases = (0..16)
            .filter(|&basis| shown >> basis & 1 == 1)
            .chain(agreed);
        if !bases.all(|basis| self.has_majority(state, set, basis)) {
            return false;
        }
        let stored = (set & self.founders & self.stores).count_ones() * 2;
        let founds = stored > self.founders.count_ones() || self.founders & !set == 0;
        let holds_founder = self.founders & !self.stores == 0 || set & self.founders != 0;
        match self.rule {
            Rule::AllBack => agreed.is_some() || set.count_ones() * 2 > self.founders.count_ones(),
            Rule::Memories => (agreed.is_some() || founds) && holds_founder,
            Rule::WithoutFounder => agreed.is_some() || founds,
            Rule::ShownReplacesFounders => agreed.is_some() || shown != 0 || founds,
        }
    }

    /// Forgets the rosters that no module knows, so that equal situations are equal states.
    fn canonical(mut state: State) -> State {
        let held = |module: &Module| module.holds.map_or(0, |(roster, _)| 1_u16 << roster);
        let known = |module: &Module| module.agreed.map_or(0, |roster| 1 << roster) | module.shown;
        let modules = || state.modules.iter();
        let all_held = modules().fold(0, |all, module| all | held(module));
        let used = modules().fold(all_held, |all, module| all | known(module));
        let (mut kept, mut renamed) = (Vec::new(), Vec::new());
        for (index, mut roster) in std::mem::take(&mut state.rosters).into_iter().enumerate() {
            renamed.push(u8::try_from(kept.len()).unwrap());
            if used >> index & 1 == 0 {
                continue;
            }
            if all_held >> index & 1 == 0 {
                (roster.members, roster.showed) = (0, 0);
            }
            roster.remembered &= roster.voters;
            kept.push(roster);
        }
        for module in &mut state.modules {
            module.agreed = module.agreed.map(|roster| renamed[usize::from(roster)]);
            module.holds = module
                .holds
                .map(|(roster, shows)| (renamed[usize::from(roster)], shows));
            let known = (0..renamed.len()).filter(|roster| module.shown >> roster & 1 == 1);
            module.shown = known.fold(0, |shown, roster| shown | 1 << renamed[roster]);
        }
        state.rosters = kept;
        state
    }
}

/// The bits of all rosters up to this one.
fn up_to(roster: u8) -> u16 {
    u16::try_from((2_u32 << roster) - 1).unwrap()
}

fn form(model: &Majorities, state: &mut State, set: Set) {
    let (agreed, shown) = Majorities::known(state, set);
    let roster = u8::try_from(state.rosters.len()).unwrap();
    let modules = state.modules.iter().enumerate();
    let retired = modules.filter(|(_, module)| module.is_retired);
    let voters = retired.fold(set, |voters, (index, _)| voters & !(1 << index));
    state.rosters.push(Roster {
        members: set,
        voters,
        remembered: voters,
        showed: if model.one_by_one { 0 } else { set },
    });
    for (index, module) in state.modules.iter_mut().enumerate() {
        if !contains(set, index) {
            continue;
        }
        (module.agreed, module.shown) = if model.one_by_one {
            (agreed, shown)
        } else {
            (Some(roster), 0)
        };
        module.holds = Some((roster, !model.one_by_one));
    }
}

impl Model for Majorities {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let started = Module {
            is_up: true,
            ..Module::default()
        };
        vec![State {
            modules: vec![started; self.modules],
            rosters: Vec::new(),
            forms_left: self.forms,
            crashes_left: self.crashes,
            retires_left: self.retires,
        }]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        let mut up: Set = 0;
        for (index, module) in state.modules.iter().enumerate() {
            if !module.is_up {
                actions.push(Action::Restart(index));
                continue;
            }
            up |= 1 << index;
            if state.crashes_left > 0 {
                actions.push(Action::Crash(index));
            }
            if state.retires_left > 0 && !module.is_retired {
                actions.push(Action::Retire(index));
            }
            match module.holds {
                Some((_, false)) => actions.push(Action::Show(index)),
                Some((roster, true)) if module.agreed != Some(roster) => {
                    let held = &state.rosters[usize::from(roster)];
                    if held.members & !held.showed == 0 {
                        actions.push(Action::Agree(index));
                    }
                }
                _ => {}
            }
        }
        if state.forms_left > 0 {
            let sets = (1..=up).filter(|set| set & !up == 0 && self.may_form(state, *set));
            actions.extend(sets.map(Action::Form));
        }
    }

    fn next_state(&self, state: &State, action: Action) -> Option<State> {
        let mut state = state.clone();
        match action {
            Action::Crash(index) => {
                state.crashes_left -= 1;
                let module = &mut state.modules[index];
                (module.is_up, module.holds) = (false, None);
                if !contains(self.stores, index) {
                    *module = Module::default();
                    for roster in &mut state.rosters {
                        roster.remembered &= !(1 << index);
                    }
                }
            }
            Action::Restart(index) => state.modules[index].is_up = true,
            Action::Retire(index) => {
                state.retires_left -= 1;
                state.modules[index].is_retired = true;
            }
            Action::Form(set) => {
                state.forms_left -= 1;
                form(self, &mut state, set);
            }
            Action::Show(index) => {
                let (roster, _) = state.modules[index].holds?;
                state.modules[index].holds = Some((roster, true));
                state.modules[index].shown |= 1 << roster;
                state.rosters[usize::from(roster)].showed |= 1 << index;
            }
            Action::Agree(index) => {
                let (roster, _) = state.modules[index].holds?;
                let module = &mut state.modules[index];
                module.agreed = Some(roster);
                module.shown &= !up_to(roster);
            }
        }
        Some(Self::canonical(state))
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![Property::always("one formation", |_, state: &State| {
            let is_formation = |index: usize, roster: &Roster| {
                let held = Some((u8::try_from(index).unwrap(), true));
                let modules = state.modules.iter().enumerate();
                let mut members = modules.filter(|&(module, _)| contains(roster.members, module));
                roster.members != 0 && members.all(|(_, module)| module.holds == held)
            };
            let rosters = state.rosters.iter().enumerate();
            rosters
                .filter(|&(index, roster)| is_formation(index, roster))
                .count()
                < 2
        })]
    }
}

/// Explores all states; returns their number, and the schedule of a violation if there is one.
fn explore(model: Majorities) -> (usize, Option<Vec<Action>>) {
    let rule = model.rule;
    let checker = model.checker().spawn_bfs().join();
    let states = checker.unique_state_count();
    let violation = checker
        .discovery("one formation")
        .map(|path| path.into_actions());
    println!("{rule:?}: {states} states, {violation:?}");
    (states, violation)
}

/// Five founders, or three and two modules that are added later.
fn model(rule: Rule, founders: Set, stores: Set) -> Majorities {
    Majorities {
        modules: 5,
        founders,
        stores,
        rule,
        forms: 4,
        crashes: 2,
        retires: 0,
        one_by_one: false,
    }
}

#[test]
fn counting_members_that_are_all_back_allows_two_formations() {
    let (_, violation) = explore(Majorities {
        forms: 6,
        crashes: 6,
        ..model(Rule::AllBack, 0b1_1111, 0)
    });
    assert!(violation.is_some());
}

#[test]
fn without_a_founder_in_each_roster_or_with_a_shown_basis_instead_two_formations_are_possible() {
    let handed_on = Majorities {
        modules: 4,
        forms: 5,
        ..model(Rule::WithoutFounder, 0b0011, 0)
    };
    let never_agreed = Majorities {
        modules: 3,
        forms: 4,
        crashes: 0,
        one_by_one: true,
        ..model(Rule::ShownReplacesFounders, 0b0011, 0)
    };
    for weaker in [handed_on, never_agreed] {
        let rule = weaker.rule;
        assert!(explore(weaker).1.is_some(), "{rule:?}");
    }
}

#[test]
fn memories_allow_one_formation_with_and_without_stores() {
    for stores in [0, 0b0_0111, 0b1_1111] {
        let (states, violation) = explore(model(Rule::Memories, 0b0_0111, stores));
        assert!(states > 10_000 && violation.is_none(), "{violation:?}");
    }
    let (states, violation) = explore(Majorities {
        modules: 3,
        forms: 3,
        retires: 1,
        one_by_one: true,
        ..model(Rule::Memories, 0b0111, 0b0001)
    });
    assert!(states > 10_000 && violation.is_none(), "{violation:?}");
}

#[test]
#[ignore = "fifteen million states, two minutes"]
fn memories_allow_one_formation_in_larger_searches() {
    for stores in [0, 0b0_0111, 0b1_1111] {
        let (_, violation) = explore(Majorities {
            forms: 5,
            crashes: 3,
            ..model(Rule::Memories, 0b0_0111, stores)
        });
        assert_eq!(violation, None);
    }
    let (_, violation) = explore(Majorities {
        modules: 4,
        forms: 3,
        retires: 1,
        one_by_one: true,
        ..model(Rule::Memories, 0b0111, 0b0001)
    });
    assert_eq!(violation, None);
}
