//! The faults of a run and their times, drawn from its seed.

mod churn;
mod hands;
mod hostile;
mod hosts;
mod processes;
mod suspended;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use formation_generate::Random;
use formation_model::{ModuleId, Stop};
use formation_protocol::Command;

pub(crate) use processes::draw_processes;

use crate::network::duration_below;
use crate::process::Way;

/// By when each process has heard others for long enough to compare its clock with theirs.
const HEARD: Duration = Duration::from_secs(4);

/// The kinds of faults of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FaultKind {
    /// None, on a network that neither loses nor delays messages.
    #[default]
    None,
    /// Processes crash, and some start again.
    Crash,
    /// The network is cut, and heals.
    Partition,
    /// Every kind: crashes, restarts, late starts, cuts, slow and stopped processes, broken drives,
    /// retirements, changed targets, forged claims, and a network that loses, delays and repeats.
    Mixed,
    /// Those of `Mixed`, more often and in a row: repeated crashes of one module, cuts that change without healing
    /// or flap, links that carry one way only, longer pauses, several targets, a driver that falls silent, and clocks that drift as
    /// far as is allowed.
    Hostile,
    /// Any module crashes and restarts at any time, several of them or all at once, while cuts come and go. In the end all run
    /// and the network is whole.
    Storm,
    /// All modules are stopped by command and resumed, once or twice; in some stops a process restarts, so that a new epoch
    /// begins.
    Stops,
    /// Modules crash and restart one by one while the network changes, slowly enough for the rest to agree in between, so that
    /// majorities are handed on; in some runs a stranger publishes rosters.
    Churn,
    /// Churn in which the clock of a module is set forward or back between two of its runs.
    Clocks,
    /// Hands push and carry modules, alone or with all that are docked to them.
    Carried,
    /// The localisation of modules jumps, and returns.
    Lost,
    /// Machines are suspended with their clocks, one after another or several at once.
    Suspended,
    /// Hosts of up to four modules crash, stop, or are cut off or suspended as one, and their stores are slow in some runs.
    Hosts,
}

impl FaultKind {
    /// All kinds with their names.
    pub const NAMED: [(&'static str, Self); 13] = [
        ("none", Self::None),
        ("crash", Self::Crash),
        ("partition", Self::Partition),
        ("mixed", Self::Mixed),
        ("hostile", Self::Hostile),
        ("storm", Self::Storm),
        ("stops", Self::Stops),
        ("churn", Self::Churn),
        ("clocks", Self::Clocks),
        ("carried", Self::Carried),
        ("lost", Self::Lost),
        ("suspended", Self::Suspended),
        ("hosts", Self::Hosts),
    ];

    /// Whether hands or localisation come between a module and its drive, which happens to robots alone.
    pub(crate) fn is_of_robots(self) -> bool {
        matches!(self, Self::Carried | Self::Lost)
    }
}

impl FromStr for FaultKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::NAMED.iter().find(|(name, _)| *name == text);
        found.map(|(_, kind)| *kind).ok_or_else(|| {
            let names = Self::NAMED.map(|(name, _)| name).join(", ");
            format!("{text} is none of {names}")
        })
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut named = Self::NAMED.iter();
        let name = named.find(|(_, kind)| kind == self).map(|(name, _)| *name);
        formatter.write_str(name.unwrap_or_default())
    }
}

/// What a module is doing when a hand takes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CarryMoment {
    /// Whatever it does.
    Any,
    /// It is frozen.
    Frozen,
    /// It moves.
    OnTheWay,
    /// It waits for others to leave its way.
    Waiting,
    /// It has settled.
    Settled,
}

impl CarryMoment {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Any,
        Self::Frozen,
        Self::OnTheWay,
        Self::Waiting,
        Self::Settled,
    ];
}

/// A fault, or the end of one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A process ends without warning.
    Crash(ModuleId),
    /// A crashed process starts again.
    Restart(ModuleId),
    /// The clock of a module whose process has ended is ahead of the others by this much from now on.
    SetClock(ModuleId, Duration),
    /// The body of a crashed module is taken away, and that is reported, with its vote or not.
    Remove {
        /// The module.
        module: ModuleId,
        /// Whether its vote goes as well.
        takes_vote: bool,
    },
    /// A process stops for a while.
    Pause(ModuleId, Duration),
    /// The machine of a process is suspended for a while: neither it nor its clock goes on.
    Suspend(ModuleId, Duration),
    /// These modules are cut off from the others.
    Cut(BTreeSet<ModuleId>),
    /// Only these links are severed, each from its first module to its second.
    Sever(BTreeSet<(ModuleId, ModuleId)>),
    /// The cut ends, and all links work.
    Heal,
    /// For a while, each input keeps a process busy.
    Slow {
        /// The module of the process.
        module: ModuleId,
        /// The time that each input takes.
        lag: Duration,
        /// The duration of the fault.
        span: Duration,
    },
    /// A process starts only now, for the first time; known from the beginning.
    StartLate(ModuleId),
    /// A module receives a command.
    Command(ModuleId, Command),
    /// All modules are to stand still, or to move again.
    Stop(Stop),
    /// A drive fails whenever it receives a goal, or works again.
    Drive {
        /// The module of the drive.
        module: ModuleId,
        /// Whether it fails from now on.
        broken: bool,
    },
    /// The driver of a module falls silent, until its process restarts.
    SilentDriver(ModuleId),
    /// A hand moves a module.
    Carry {
        /// The module.
        module: ModuleId,
        /// What it waits for, for up to a minute.
        moment: CarryMoment,
        /// Whether it takes along all modules that are docked to that.
        with_docked: bool,
        /// How far, along x and y.
        way: Way,
    },
    /// The poses of a module are measured this far off where it is, from now on.
    Mislead(ModuleId, Way),
    /// A participant that is not a module forges claims from now on.
    ForgeClaims,
    /// A participant that is not a module publishes a roster, the voters of which it invented.
    ForgeRoster,
    /// The target is withdrawn.
    Withdraw,
    /// A target is announced: the scenario's own, or one drawn from a seed.
    Announce(Option<u64>),
}

impl Fault {
    /// The time after which it ends by itself.
    pub(crate) fn span(&self) -> Duration {
        match self {
            Self::Pause(_, span) | Self::Suspend(_, span) | Self::Slow { span, .. } => *span,
            _ => Duration::ZERO,
        }
    }
}

/// A fault and its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScheduledFault {
    /// When it occurs.
    pub at: Duration,
    /// The fault.
    pub fault: Fault,
}

/// Draws the faults of one run, in the order of their times, all before `end`.
///
/// Fewer than half of the modules crash for good, so that a majority of the first roster remains; the seed decides which of
/// them do, and whether the others hold a majority of a later roster.
#[must_use]
pub fn draw(
    kind: FaultKind,
    modules: &[ModuleId],
    end: Duration,
    random: &mut Random,
) -> Vec<ScheduledFault> {
    let mut drawing = Drawing {
        modules,
        end,
        random,
        faults: Vec::new(),
    };
    match kind {
        FaultKind::None => {}
        FaultKind::Crash => drawing.crashes(),
        FaultKind::Partition => drawing.cuts(),
        FaultKind::Mixed => {
            drawing.crashes();
            drawing.cuts();
            let pauses = drawing.random.below(3);
            drawing.pauses(pauses, 12_000);
            drawing.rarer();
        }
        FaultKind::Hostile => {
            drawing.hostile();
            drawing.silent_driver();
        }
        FaultKind::Storm => drawing.storm(),
        FaultKind::Stops => drawing.stops(),
        FaultKind::Churn => drawing.churn(),
        FaultKind::Clocks => {
            drawing.churn();
            drawing.clocks();
        }
        FaultKind::Carried => drawing.carried(),
        FaultKind::Lost => drawing.lost(),
        FaultKind::Suspended => drawing.suspended(),
        FaultKind::Hosts => drawing.hosts(),
    }
    drawing.faults.sort_by_key(|fault| fault.at);
    drawing.removals();
    drawing.faults.sort_by_key(|fault| fault.at);
    drawing.faults
}

/// The faults of one run while they are drawn.
struct Drawing<'a> {
    modules: &'a [ModuleId],
    end: Duration,
    random: &'a mut Random,
    faults: Vec<ScheduledFault>,
}

impl Drawing<'_> {
    fn add(&mut self, at: Duration, fault: Fault) {
        self.faults.push(ScheduledFault { at, fault });
    }

    fn one_in(&mut self, chance: u64) -> bool {
        self.random.below(chance) == 0
    }

    fn module(&mut self) -> ModuleId {
        self.modules[self.random.index(self.modules.len())]
    }

    /// All modules in random order.
    fn shuffled(&mut self) -> Vec<ModuleId> {
        let mut modules = self.modules.to_vec();
        self.random.shuffle(&mut modules);
        modules
    }

    /// At least one module, and not all.
    fn some_modules(&mut self) -> BTreeSet<ModuleId> {
        let mut some = self.shuffled();
        let others = self.modules.len().saturating_sub(1).max(1);
        some.truncate(1 + self.random.index(others));
        some.into_iter().collect()
    }

    /// A time from `from` until `until`.
    fn time(&mut self, from: Duration, until: Duration) -> Duration {
        from + duration_below(self.random, until.saturating_sub(from))
    }

    /// A duration of at least `least` milliseconds and less than `spread` milliseconds more.
    fn millis(&mut self, least: u64, spread: u64) -> Duration {
        Duration::from_millis(least + self.random.below(spread))
    }

    fn crashes(&mut self) {
        if self.modules.len() <= 2 {
            return;
        }
        let modules = self.shuffled();
        let limit = (modules.len() - 1) / 2;
        let count = 1 + self.random.index(limit.min(5));
        for &module in modules.iter().take(count) {
            let at = self.time(Duration::ZERO, self.end);
            self.add(at, Fault::Crash(module));
            if self.one_in(2) {
                let again = self.time(at, self.end);
                self.add(again, Fault::Restart(module));
            }
        }
    }

    /// The body of every second module that crashes for good is taken away within 20 s. The time of the crash decides, so
    /// that all other draws stay as they are.
    fn removals(&mut self) {
        let mut lost = BTreeMap::new();
        for ScheduledFault { at, fault } in &self.faults {
            match fault {
                Fault::Crash(module) => lost.insert(*module, *at),
                Fault::Restart(module) => lost.remove(module),
                _ => None,
            };
        }
        for (module, crashed) in lost {
            let chance = Random::from_seed(u64::from(crashed.subsec_micros())).below(40_000);
            if chance < 20_000 {
                let at = crashed + Duration::from_millis(chance);
                let takes_vote = chance.is_multiple_of(2);
                self.add(at, Fault::Remove { module, takes_vote });
            }
        }
    }

    /// The driver of a module falls silent, in one run of four. The times of the other faults decide, so that these stay as they
    /// are.
    fn silent_driver(&mut self) {
        // Small formations would soon have no module left to take a spot.
        if self.modules.len() < 5 {
            return;
        }
        let times = self.faults.iter().map(|fault| fault.at.as_micros());
        let seed = u64::try_from(times.sum::<u128>()).unwrap_or_default();
        let mut random = Random::from_seed(seed);
        if random.below(4) == 0 {
            let module = self.modules[random.index(self.modules.len())];
            let at = duration_below(&mut random, self.end);
            self.add(at, Fault::SilentDriver(module));
        }
    }

    fn cuts(&mut self) {
        if self.modules.len() <= 1 {
            return;
        }
        let count = [1, 2][self.random.index(2)];
        let share = self.end / count;
        for turn in 0..count {
            let begin = self.time(share * turn, share * turn + share / 2);
            let heal = self.time(begin, share * (turn + 1));
            let aside = self.some_modules();
            self.add(begin, Fault::Cut(aside));
            // One cut in eight lasts for ever, if it is the last.
            if turn + 1 < count || !self.one_in(8) {
                self.add(heal, Fault::Heal);
            }
        }
    }

    fn pauses(&mut self, count: u64, spread_ms: u64) {
        for _ in 0..count {
            let module = self.module();
            let at = self.time(Duration::ZERO, self.end);
            let pause = self.millis(200, spread_ms);
            self.add(at, Fault::Pause(module, pause));
        }
    }

    fn stops(&mut self) {
        let share = self.end / 2;
        for turn in 0..2 {
            let at = self.time(share * turn, share * turn + share / 2);
            let resumed_at = at + self.millis(500, 10_000);
            for (revision, stopped, at) in [(1, true, at), (2, false, resumed_at)] {
                let revision = u64::from(2 * turn) + revision;
                self.add(at, Fault::Stop(Stop { revision, stopped }));
            }
            if self.one_in(2) {
                let module = self.module();
                let crash = self.time(at, resumed_at);
                let restart = self.time(crash, resumed_at);
                self.add(crash, Fault::Crash(module));
                self.add(restart, Fault::Restart(module));
            }
        }
    }

    /// Faults that occur in some of the mixed runs only: each of these in one run in three or fewer.
    fn rarer(&mut self) {
        let second = Duration::from_secs(1);
        if self.one_in(3) {
            let module = self.module();
            let at = self.time(Duration::ZERO, self.end);
            let lag = self.millis(1, 10);
            let span = self.millis(1_000, 15_000);
            self.add(at, Fault::Slow { module, lag, span });
        }
        if self.one_in(4) {
            let module = self.module();
            let at = self.time(second, self.end);
            self.add(at, Fault::StartLate(module));
        }
        // Small formations would soon have no module left to take a spot.
        if self.modules.len() >= 5 {
            for broken in [false, true] {
                if self.one_in(4) {
                    let module = self.module();
                    let at = self.time(second, self.end);
                    let fault = if broken {
                        Fault::Drive { module, broken }
                    } else {
                        Fault::Command(module, Command::Retire)
                    };
                    self.add(at, fault);
                }
            }
        }
        if self.one_in(4) {
            self.add(Duration::ZERO, Fault::ForgeClaims);
        }
        match self.random.below(10) {
            0 => self.announcement(),
            1 => {
                let at = self.time(second, self.end);
                let again = self.time(at, self.end);
                self.add(at, Fault::Withdraw);
                self.add(again, Fault::Announce(None));
            }
            _ => {}
        }
    }

    /// Another target.
    fn announcement(&mut self) {
        let at = self.time(Duration::from_secs(1), self.end);
        let seed = self.random.below(u64::MAX);
        self.add(at, Fault::Announce(Some(seed)));
    }
}
