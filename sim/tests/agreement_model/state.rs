//! What the model remembers: modules, rosters, links, commands, and how many faults are left.

use std::hash::{Hash, Hasher};

/// A set of modules, one bit each.
pub type Set = u8;

/// The most modules that a model may have.
pub const MAX: usize = 5;

/// An age or a countdown that stands for "not at all".
pub const NEVER: u8 = u8::MAX;

pub fn bit(module: usize) -> Set {
    1 << module
}

pub fn contains(set: Set, module: usize) -> bool {
    set >> module & 1 == 1
}

pub fn each(set: Set) -> impl Iterator<Item = usize> {
    (0..MAX).filter(move |&module| contains(set, module))
}

/// What a resume file holds, and what a process without one knows until it ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Memory {
    /// Whether it counts in a majority (rule 5).
    pub knows: bool,
    /// The rosters whose bodies it knows, one bit each. The rule cannot read this; the second property does.
    pub plans: u8,
    /// The removals that it saw in force.
    pub removed: Set,
    /// The removals in rosters for which it showed a digest.
    pub listed: Set,
    /// The removals that it was told of.
    pub proposed: Set,
    /// Ticks since the last of them.
    pub removal_age: u8,
}

/// One run of a module's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Run {
    pub age: u8,
    /// Whether it showed the digest of any roster.
    pub has_shown: bool,
    /// The roster whose digest runs of this process showed last.
    pub last: Option<u8>,
    /// Ticks until nobody can move by another one that they showed.
    pub others: u8,
    /// False for a run that started after the vote of its module was removed.
    pub has_vote: bool,
    /// Ticks for which it slept since it last heard a heartbeat: by so many it judges ages too low.
    pub skew: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Module {
    pub is_up: bool,
    pub has_file: bool,
    pub run: Run,
    pub memory: Memory,
    pub roster: Option<u8>,
    pub shows: bool,
    /// Age of the latest heartbeat of each module that shows the digest of this module's roster.
    pub heard: [u8; MAX],
    /// Age of the latest heartbeat of each module that a removal may name, since this run began to listen.
    pub listened: [u8; MAX],
    /// Ticks since it saw its roster in force.
    pub agreed: u8,
    /// The roster by which its drive still moves although the goal is withdrawn, and for how many ticks.
    pub tail: Option<(u8, u8)>,
    /// The roster whose digest it showed before, and how long ago that ended: such heartbeats may still be on their way.
    pub former: Option<(u8, u8)>,
}

/// Writes all fields at once, which halves the time of a search.
impl Hash for Module {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        let option = |roster: Option<u8>| roster.unwrap_or(NEVER);
        let pair = |pair: Option<(u8, u8)>| pair.unwrap_or((NEVER, NEVER));
        let flags = [
            self.is_up,
            self.has_file,
            self.shows,
            self.run.has_shown,
            self.run.has_vote,
            self.memory.knows,
        ];
        let flags = flags
            .iter()
            .fold(0, |flags, &flag| flags << 1 | u8::from(flag));
        let (tail, former) = (pair(self.tail), pair(self.former));
        let memory = &self.memory;
        let (run, seen) = (
            [self.run.age, self.run.skew],
            [option(self.roster), self.agreed],
        );
        let last = [option(self.run.last), self.run.others];
        hasher.write(&self.heard);
        hasher.write(&self.listened);
        hasher.write(&[
            flags,
            run[0],
            run[1],
            last[0],
            last[1],
            seen[0],
            seen[1],
            tail.0,
            tail.1,
            former.0,
            former.1,
            memory.plans,
            memory.removed,
            memory.listed,
            memory.proposed,
            memory.removal_age,
        ]);
    }
}

impl Run {
    /// A run before which there was none.
    pub fn first(age: u8) -> Self {
        Self {
            age,
            has_shown: false,
            last: None,
            others: 0,
            has_vote: true,
            skew: 0,
        }
    }

    /// A run that forgot what those before it showed, which matters for so many ticks.
    pub fn forgetful(ticks: u8) -> Self {
        Self {
            others: ticks,
            ..Self::first(0)
        }
    }

    /// The next run of the same process, which knows what this one showed.
    pub fn next(self, ticks: u8) -> Self {
        let last = self.last.filter(|_| self.others == 0);
        Self {
            last,
            has_vote: self.has_vote,
            ..Self::forgetful(if last.is_some() { 0 } else { ticks })
        }
    }
}

impl Module {
    pub fn leave(&mut self) {
        (self.roster, self.shows, self.agreed) = (None, false, NEVER);
        self.heard = [NEVER; MAX];
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Roster {
    pub members: Set,
    /// The removals that it lists.
    pub removed: Set,
    /// Whether it holds all voters that are not removed.
    pub is_whole: bool,
    /// The rosters whose bodies it lists.
    pub plans: u8,
    /// Ticks since it was published.
    pub age: u8,
    /// Ticks until rule 3 lets it move without waiting for the lease.
    pub idle: u8,
    pub has_moved: bool,
}

/// How many of each event may still happen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Budget {
    pub rosters: u8,
    pub crashes: u8,
    /// Crashes after which the resume file is lost.
    pub losses: u8,
    /// Commands that take a vote.
    pub removals: u8,
    /// Those of them that may name a run that has not ended.
    pub false_removals: u8,
    /// Commands that name no run.
    pub blind: u8,
    pub link_changes: u8,
    /// Ticks for which a module may sleep.
    pub sleeps: u8,
    /// Processes that begin new runs.
    pub rejoins: u8,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct State {
    pub modules: Vec<Module>,
    pub rosters: Vec<Roster>,
    /// The links that are down: bit `to * MAX + from`.
    pub down: u32,
    /// The modules with slow clocks, where each clock has one speed.
    pub slow: Set,
    /// The modules of which a command took the vote.
    pub commanded: Set,
    /// Those of them whose named run is the present one, or the last.
    pub named: Set,
    /// The last roster whose bodies a later one must know.
    pub last: Option<u8>,
    /// 1 if a roster moved, 2 if another did, 3 if that first moved after a crash.
    pub moves: u8,
    /// Whether a roster moved that did not list the bodies of the one that had moved before.
    pub is_ignorant: bool,
    pub left: Budget,
}

impl State {
    pub fn roster_of(&self, module: usize) -> Option<&Roster> {
        let roster = self.modules[module].roster?;
        Some(&self.rosters[usize::from(roster)])
    }

    /// Whether heartbeats pass from one module to another.
    pub fn is_linked(&self, from: usize, to: usize) -> bool {
        self.down >> (to * MAX + from) & 1 == 0
    }
}
