//! Which faults strike a run, and when; drawn from its seed.

mod hostile;

use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use formation::generate::Random;
use formation::model::ModuleId;
use formation::protocol::Command;

/// Which kinds of faults strike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FaultKind {
    /// None, on a network that neither loses nor delays.
    #[default]
    None,
    /// Processes crash, and some start again.
    Crash,
    /// The network is cut and heals.
    Partition,
    /// All that can be drawn: crashes, restarts, late starts, cuts, slow and stopped processes, broken drives,
    /// retirements, changed targets, forged claims, and a network that loses, delays and repeats.
    Mixed,
    /// All that is in `Mixed`, more often and in a row: repeated crashes of one module, cuts that change without healing
    /// or flap, links that carry one way only, longer pauses, several targets, and clocks that drift as far as is allowed.
    Hostile,
}

impl FromStr for FaultKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            "crash" => Ok(Self::Crash),
            "partition" => Ok(Self::Partition),
            "mixed" => Ok(Self::Mixed),
            "hostile" => Ok(Self::Hostile),
            other => Err(format!(
                "{other} is none of none, crash, partition, mixed, hostile"
            )),
        }
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::None => "none",
            Self::Crash => "crash",
            Self::Partition => "partition",
            Self::Mixed => "mixed",
            Self::Hostile => "hostile",
        })
    }
}

/// What strikes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Strike {
    /// A process ends without warning.
    Crash(ModuleId),
    /// A crashed process starts again.
    Restart(ModuleId),
    /// A process stands still for a while.
    Pause(ModuleId, Duration),
    /// These modules are cut off from the others.
    Cut(BTreeSet<ModuleId>),
    /// Only these links are severed, each from its first module to its second.
    Sever(BTreeSet<(ModuleId, ModuleId)>),
    /// The cut ends, and all links work.
    Heal,
    /// For a span, each input keeps a process busy for so long.
    Slow {
        /// Whose process.
        module: ModuleId,
        /// For how long each input keeps it busy.
        lag: Duration,
        /// For how long it is slow.
        span: Duration,
    },
    /// A process starts only now, for the first time; known from the beginning.
    StartLate(ModuleId),
    /// A module receives a command.
    Command(ModuleId, Command),
    /// A drive fails whenever it is to go, or works again.
    Drive {
        /// Whose drive.
        module: ModuleId,
        /// Whether it fails from now on.
        broken: bool,
    },
    /// A stranger forges claims from now on.
    ForgeClaims,
    /// The target is withdrawn.
    Withdraw,
    /// A target is announced: the scenario's own, or one drawn from a seed.
    Announce(Option<u64>),
}

impl Strike {
    /// How long it lasts of itself.
    pub(crate) fn span(&self) -> Duration {
        match self {
            Self::Pause(_, span) | Self::Slow { span, .. } => *span,
            _ => Duration::ZERO,
        }
    }
}

/// A fault and its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// When it strikes.
    pub at: Duration,
    /// What it is.
    pub strike: Strike,
}

/// Draws the faults of one run, in the order of their times, all before `end`.
///
/// Fewer than half of the modules crash for good, so that a majority of the first roster always lives; which of them do,
/// and whether those that are left hold a majority of a later roster, is up to the seed.
#[must_use]
pub fn draw(
    kind: FaultKind,
    modules: &[ModuleId],
    end: Duration,
    random: &mut Random,
) -> Vec<Fault> {
    if kind == FaultKind::Hostile {
        return hostile::draw(modules, end, random);
    }
    let mut faults = Vec::new();
    let crashes = matches!(kind, FaultKind::Crash | FaultKind::Mixed);
    let cuts = matches!(kind, FaultKind::Partition | FaultKind::Mixed);
    if crashes && modules.len() > 2 {
        let mut victims = modules.to_vec();
        random.shuffle(&mut victims);
        let limit = (modules.len() - 1) / 2;
        let count = 1 + random.index(limit.min(5));
        for &victim in victims.iter().take(count) {
            let at = time(random, Duration::ZERO, end);
            faults.push(Fault {
                at,
                strike: Strike::Crash(victim),
            });
            if random.below(2) == 0 {
                let again = time(random, at, end);
                faults.push(Fault {
                    at: again,
                    strike: Strike::Restart(victim),
                });
            }
        }
    }
    if cuts && modules.len() > 1 {
        let count = 1 + random.below(2);
        let share = end / u32::try_from(count).unwrap_or(1);
        for turn in 0..u32::try_from(count).unwrap_or(1) {
            let begin = time(random, share * turn, share * turn + share / 2);
            let heal = time(random, begin, share * (turn + 1));
            let mut aside = modules.to_vec();
            random.shuffle(&mut aside);
            aside.truncate(1 + random.index(modules.len() - 1));
            faults.push(Fault {
                at: begin,
                strike: Strike::Cut(aside.into_iter().collect()),
            });
            // One cut in eight lasts for ever, if it is the last.
            if turn + 1 < u32::try_from(count).unwrap_or(1) || random.below(8) > 0 {
                faults.push(Fault {
                    at: heal,
                    strike: Strike::Heal,
                });
            }
        }
    }
    if kind == FaultKind::Mixed {
        for _ in 0..random.below(3) {
            let module = modules[random.index(modules.len())];
            let at = time(random, Duration::ZERO, end);
            let pause = Duration::from_millis(200 + random.below(12_000));
            faults.push(Fault {
                at,
                strike: Strike::Pause(module, pause),
            });
        }
        draw_rarer(modules, end, random, &mut faults);
    }
    faults.sort_by_key(|fault| fault.at);
    faults
}

/// A time from `from` until `until`.
fn time(random: &mut Random, from: Duration, until: Duration) -> Duration {
    let span = u64::try_from(until.saturating_sub(from).as_micros()).unwrap_or(u64::MAX);
    from + Duration::from_micros(random.below(span.max(1)))
}

/// What strikes some of the mixed runs only: each of these one run in three or fewer.
fn draw_rarer(modules: &[ModuleId], end: Duration, random: &mut Random, faults: &mut Vec<Fault>) {
    let strikes_one_in = |chance: u64, random: &mut Random| random.below(chance) == 0;
    if strikes_one_in(3, random) {
        let module = modules[random.index(modules.len())];
        let at = time(random, Duration::ZERO, end);
        let lag = Duration::from_millis(1 + random.below(10));
        let span = Duration::from_millis(1_000 + random.below(15_000));
        let strike = Strike::Slow { module, lag, span };
        faults.push(Fault { at, strike });
    }
    if strikes_one_in(4, random) {
        let module = modules[random.index(modules.len())];
        let at = time(random, Duration::from_secs(1), end);
        faults.push(Fault {
            at,
            strike: Strike::StartLate(module),
        });
    }
    // Small formations would soon have nobody left to take a spot.
    if modules.len() >= 5 {
        for broken in [false, true] {
            if strikes_one_in(4, random) {
                let module = modules[random.index(modules.len())];
                let at = time(random, Duration::from_secs(1), end);
                let strike = if broken {
                    Strike::Drive {
                        module,
                        broken: true,
                    }
                } else {
                    Strike::Command(module, Command::Retire)
                };
                faults.push(Fault { at, strike });
            }
        }
    }
    if strikes_one_in(4, random) {
        faults.push(Fault {
            at: Duration::ZERO,
            strike: Strike::ForgeClaims,
        });
    }
    match random.below(10) {
        0 => {
            let at = time(random, Duration::from_secs(1), end);
            let strike = Strike::Announce(Some(random.below(u64::MAX)));
            faults.push(Fault { at, strike });
        }
        1 => {
            let at = time(random, Duration::from_secs(1), end);
            let again = time(random, at, end);
            faults.push(Fault {
                at,
                strike: Strike::Withdraw,
            });
            faults.push(Fault {
                at: again,
                strike: Strike::Announce(None),
            });
        }
        _ => {}
    }
}
