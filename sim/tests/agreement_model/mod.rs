//! The rule of agreement, checked exhaustively: no two plans are ever in motion at once, and none forgets where robots stand.
//!
//! This is the rule of docs/protocol.md: 1, 5 and 6 are Q1 to Q4, 2 and 3 are A2, 7 is M8. The protocol counts the lease from the
//! roster, and allows ties once a removal is in force. A roster is a set of modules that receive each other and that holds more than half of the voters; it is in force while
//! all its members show it.
//!
//! 1. Voters belong to the session and stay the same. A roster needs more than half of them, or exactly half with the lowest while no
//!    removal of a vote is in force.
//! 2. By A1 the last motion by a roster ends a lease after a shared voter last showed it, and by A2 the first motion by the next one begins
//!    a lease and its margins later. No memory is needed for that.
//! 3. The wait is left out if the roster holds all voters, each of their runs is older than the wait and has shown no plan before, and no
//!    removal that the roster counts became known more recently. It is left out as well if no removal counts and the voters can have
//!    shown no plan within the wait but one and the same, whose members are all members again. Only voters are asked here, where the
//!    protocol asks all members: that admits more.
//! 4. The convener calls the largest set of modules that receive each other. It is not modelled: any set may form.
//! 5. Where robots stand must be known: a voter knows if its file says so, or if it has been in a roster in force in this run. A majority
//!    counts those that know; a roster of all voters needs none.
//! 6. A removal is proposed by frozen states, and refused by whoever hears the run that it names.
//! 7. Nobody re-bases the clock of another. Who learns that its own stood still halts, and begins a new run if it holds a plan.
//!
//! [`Agreement`] is a model of rules 1 to 3 and 5 to 7, for up to five modules. [`rule::Rule`] names the rule that holds, its mutants, and
//! the rule as it was first written down, "the page", where the model refutes it. Begin with `actions.rs`; `configurations.rs` says which
//! part each search covers, `rule_holds.rs` and `mutants.rs` are the tests.
//!
//! # Time
//! Time passes in ticks, between which anything may happen in any order. Each module counts ages in true ticks, and each limit
//! is taken at its worst: A1 accepts a heartbeat for `lease + margin` ticks, as on a slow clock that subtracts the least delay
//! of the link, and A2 and rule 3 end as on a fast clock. That admits all that clocks of two constant speeds admit, and clocks
//! whose speed changes; `has_speeds` gives each module one speed for good instead. A module has a goal whenever it may have
//! one, so a module that begins later or stops earlier does nothing that is not covered. A drive stops `stop` ticks after its
//! goal was withdrawn, or after its process crashed.
//!
//! # Messages
//! With [`Network::Lossy`] each heartbeat arrives or does not, which covers all cuts, one-way links and losses; with
//! `Times::delay`, one that shows the former digest may arrive after its sender left that roster. With [`Network::Links`]
//! links are up or down in each direction, and every heartbeat passes over a link that is up: hearing more only permits more,
//! except for removals, and for those links decide.
//!
//! Rosters are formed in one step, when all members have frozen: each stands and shows no older digest, so what it showed
//! before ended before. Any set that the rule admits may form at any time, whoever convenes: this covers rule 4, all gatherings
//! that fail, and all orders of epochs. What a member says of itself when it freezes still holds when the roster is published,
//! as it cannot return to an earlier epoch.
//!
//! # Equal states
//! `canonical.rs` forgets rosters by which nobody can move any more, and what only later rosters need once none may be formed;
//! with `sorts` it also puts voters in order, as the rule does not tell them apart. Mutants are searched without the latter,
//! so that their counterexamples can be read.
//!
//! # What is left out
//! Two living runs of one voter, and files restored from a backup: assumptions, see [`rule::Rule::EmptyFileKnows`] for what the
//! latter does. A drive that goes on for up to `lease_s` after its process crashed. Bodies of modules without a vote that no
//! member knows when all voters begin anew. Epoch numbers, and so conveners that open one twice. Digests that differ. Heartbeats
//! that queue up while their receiver sleeps and show only part of the sleep. Progress, except that rosters can move.

mod actions;
mod canonical;
mod configurations;
mod motion;
mod mutants;
mod rule;
mod rule_holds;
mod state;

use stateright::{Model, Property};

use actions::Action;
use rule::Rule;
use state::{Budget, MAX, Memory, Module, NEVER, Run, Set, State, contains};

const GOALS: &str = "goals by one plan";
const MOTION: &str = "motion by one plan";
const BODIES: &str = "bodies known";
const IN_FORCE: &str = "a roster in force";
const MOVES: &str = "a roster moves";
const AFTER_CRASH: &str = "another moves after a crash";
const WITHOUT_WAIT: &str = "a roster moves without waiting";

/// Limits, in ticks.
#[derive(Clone, Copy, Debug)]
struct Times {
    lease: u8,
    /// By how much A1 on a slow clock, with the least delay of a link, exceeds the lease on a fast one.
    margin: u8,
    /// How much later than its goal a drive stops.
    stop: u8,
    /// How long a run must be silent before its removal is listed.
    suspicion: u8,
    /// How late a heartbeat may arrive.
    delay: u8,
}

/// What the lease of A2 counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LeaseFrom {
    /// As on the page: the member sees that all others show the digest.
    Agreement,
    /// The roster is published, after all members have frozen. It comes earlier, so this admits all that `Agreement` does.
    Roster,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Network {
    /// Each heartbeat arrives or does not.
    Lossy,
    /// Each link is up or down in each direction.
    Links,
}

/// What a search looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Search {
    /// A violation.
    Safety,
    /// That rosters come into force and move.
    Progress,
}

#[derive(Clone, Copy, Debug)]
struct Agreement {
    rule: Rule,
    modules: usize,
    /// They know at first that nothing came before: whoever begins the session says so to its first runs.
    voters: Set,
    /// The modules with resume files.
    files: Set,
    times: Times,
    lease_from: LeaseFrom,
    network: Network,
    budget: Budget,
    search: Search,
    /// Members of a roster show its digest one by one; otherwise all at once.
    one_by_one: bool,
    /// Modules that the rule does not tell apart are sorted.
    sorts: bool,
    /// Each clock is slow or fast for good; otherwise each is the worse of both wherever it is read.
    has_speeds: bool,
}

impl Model for Agreement {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let run = Run::first(self.idle_wait());
        let module = |index: usize| Module {
            is_up: true,
            has_file: contains(self.files, index),
            run,
            memory: Memory {
                knows: contains(self.voters, index),
                ..Memory::default()
            },
            roster: None,
            shows: false,
            heard: [NEVER; MAX],
            listened: [self.times.suspicion; MAX],
            agreed: NEVER,
            tail: None,
            former: None,
        };
        let speeds = if self.has_speeds {
            1 << self.modules
        } else {
            1
        };
        let state = |slow| State {
            slow,
            modules: (0..self.modules).map(module).collect(),
            rosters: Vec::new(),
            down: 0,
            commanded: 0,
            named: 0,
            last: None,
            moves: 0,
            is_ignorant: false,
            left: self.budget,
        };
        (0..speeds).map(state).collect()
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        if self.is_over(state) {
            return;
        }
        actions.push(Action::Tick);
        for module in 0..self.modules {
            self.module_actions(state, module, actions);
        }
        if state.left.rosters > 0 {
            self.open_actions(state, actions);
        }
        if state.left.blind > 0 {
            actions.push(Action::Blind);
        }
        self.network_actions(state, actions);
    }

    fn next_state(&self, state: &State, action: Action) -> Option<State> {
        let mut state = state.clone();
        self.apply(&mut state, action)?;
        self.pass_heartbeats(&mut state);
        self.note_motion(&mut state);
        self.canonical(&mut state);
        Some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        match self.search {
            Search::Safety => vec![
                Property::always(GOALS, |model: &Self, state: &State| {
                    model.goals(state).count_ones() < 2
                }),
                Property::always(MOTION, |model: &Self, state: &State| {
                    model.motion(state).count_ones() < 2
                }),
                Property::always(BODIES, |_, state: &State| !state.is_ignorant),
            ],
            Search::Progress => vec![
                Property::sometimes(IN_FORCE, |_, state: &State| {
                    state.modules.iter().any(|module| module.agreed != NEVER)
                }),
                Property::sometimes(MOVES, |_, state: &State| state.moves > 0),
                Property::sometimes(AFTER_CRASH, |_, state: &State| state.moves > 2),
                Property::sometimes(WITHOUT_WAIT, |model: &Self, state: &State| {
                    (0..model.modules).any(|module| {
                        model.goal(state, module).is_some() && !model.has_waited(state, module)
                    })
                }),
            ],
        }
    }
}
