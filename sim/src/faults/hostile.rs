//! The faults of a hostile run: many at once and in a row, and all over at its end.

use std::collections::BTreeSet;
use std::time::Duration;

use formation::generate::Random;
use formation::model::ModuleId;

use super::{Fault, Strike, draw_rarer, time};

/// Draws them in the order of their times. Fewer than half of the modules crash at all, and the network is whole in the end.
pub(super) fn draw(modules: &[ModuleId], end: Duration, random: &mut Random) -> Vec<Fault> {
    let mut faults = Vec::new();
    draw_crashes(modules, end, random, &mut faults);
    draw_cuts(modules, end, random, &mut faults);
    for _ in 0..random.below(5) {
        let module = modules[random.index(modules.len())];
        let at = time(random, Duration::ZERO, end);
        let pause = Duration::from_millis(200 + random.below(15_000));
        faults.push(Fault {
            at,
            strike: Strike::Pause(module, pause),
        });
    }
    draw_rarer(modules, end, random, &mut faults);
    for _ in 0..random.below(4) {
        let at = time(random, Duration::from_secs(1), end);
        let strike = Strike::Announce(Some(random.below(u64::MAX)));
        faults.push(Fault { at, strike });
    }
    faults.push(Fault {
        at: end,
        strike: Strike::Heal,
    });
    faults.sort_by_key(|fault| fault.at);
    faults
}

/// Some modules crash up to three times in a row; the last time half of them for good.
fn draw_crashes(modules: &[ModuleId], end: Duration, random: &mut Random, faults: &mut Vec<Fault>) {
    let limit = modules.len().saturating_sub(1) / 2;
    let mut victims = modules.to_vec();
    random.shuffle(&mut victims);
    victims.truncate(random.index(limit.min(5) + 1));
    for victim in victims {
        let times = 1 + u32::try_from(random.below(3)).unwrap_or(0);
        let share = end / times;
        for turn in 0..times {
            let at = time(random, share * turn, share * (turn + 1));
            let again = time(random, at, share * (turn + 1));
            faults.push(Fault {
                at,
                strike: Strike::Crash(victim),
            });
            if turn + 1 < times || random.below(2) == 0 {
                faults.push(Fault {
                    at: again,
                    strike: Strike::Restart(victim),
                });
            }
        }
    }
}

/// The network changes every few seconds, mostly without being whole in between.
fn draw_cuts(modules: &[ModuleId], end: Duration, random: &mut Random, faults: &mut Vec<Fault>) {
    let mut at = time(random, Duration::ZERO, end / 4);
    while at < end {
        let strike = match random.below(6) {
            0 => Strike::Heal,
            1 | 2 => Strike::Cut(some_of(modules, random)),
            3 => Strike::Sever(one_way(modules, random)),
            4 => Strike::Sever(some_links(modules, random)),
            _ => {
                at = flap(modules, at, end, random, faults);
                Strike::Heal
            }
        };
        faults.push(Fault { at, strike });
        at += Duration::from_millis(500 + random.below(10_000));
    }
}

/// A cut that comes and goes; returns when it has ended.
fn flap(
    modules: &[ModuleId],
    from: Duration,
    end: Duration,
    random: &mut Random,
    faults: &mut Vec<Fault>,
) -> Duration {
    let aside = some_of(modules, random);
    let period = Duration::from_millis(100 + random.below(3_000));
    let mut at = from;
    for _ in 0..2 + random.below(8) {
        for strike in [Strike::Cut(aside.clone()), Strike::Heal] {
            if at < end {
                faults.push(Fault { at, strike });
            }
            at += period;
        }
    }
    at.min(end)
}

/// At least one module, and not all.
fn some_of(modules: &[ModuleId], random: &mut Random) -> BTreeSet<ModuleId> {
    let mut some = modules.to_vec();
    random.shuffle(&mut some);
    some.truncate(1 + random.index(modules.len().saturating_sub(1).max(1)));
    some.into_iter().collect()
}

/// A few modules that either hear none of the others, or are heard by none.
fn one_way(modules: &[ModuleId], random: &mut Random) -> BTreeSet<(ModuleId, ModuleId)> {
    let mut few = modules.to_vec();
    random.shuffle(&mut few);
    few.truncate(1 + random.index((modules.len() / 3).max(1)));
    let few: BTreeSet<ModuleId> = few.into_iter().collect();
    let deaf = random.below(2) == 0;
    let others = modules.iter().filter(|module| !few.contains(module));
    others
        .flat_map(|&other| few.iter().map(move |&one| (one, other)))
        .map(|(one, other)| if deaf { (other, one) } else { (one, other) })
        .collect()
}

/// A few links anywhere, in one direction or both, so that who hears whom is not transitive.
fn some_links(modules: &[ModuleId], random: &mut Random) -> BTreeSet<(ModuleId, ModuleId)> {
    let mut links = BTreeSet::new();
    for _ in 0..1 + random.index(modules.len()) {
        let from = modules[random.index(modules.len())];
        let to = modules[random.index(modules.len())];
        links.insert((from, to));
        if random.below(2) == 0 {
            links.insert((to, from));
        }
    }
    links
}
