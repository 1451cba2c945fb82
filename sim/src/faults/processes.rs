//! Which modules of a run share a process.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_generate::Random;
use formation_model::ModuleId;

use super::{Fault, ScheduledFault};

/// The most modules of a process.
const MODULES_MAX: u64 = 4;

/// Stands for a module where only the others in a fault are compared.
const ITSELF: ModuleId = ModuleId(u32::MAX);

/// Draws which modules share a process: one to four that the faults of processes and links treat alike, as a process fails as one.
/// Those of a process have stores, or none has.
pub(crate) fn draw_processes(
    faults: &[ScheduledFault],
    modules: &[ModuleId],
    has_store: impl Fn(ModuleId) -> bool,
    random: &mut Random,
) -> Vec<Vec<ModuleId>> {
    type Treatment = (bool, Vec<(Duration, Fault)>);
    let mut alike: Vec<(Treatment, Vec<ModuleId>)> = Vec::new();
    for &module in modules {
        let treated = faults.iter().filter_map(|scheduled| {
            let treatment = treatment_of(module, &scheduled.fault)?;
            Some((scheduled.at, treatment))
        });
        let treatment = (has_store(module), treated.collect());
        match alike.iter_mut().find(|(known, _)| *known == treatment) {
            Some((_, modules)) => modules.push(module),
            None => alike.push((treatment, vec![module])),
        }
    }
    let mut processes = Vec::new();
    for (_, mut left) in alike {
        random.shuffle(&mut left);
        while !left.is_empty() {
            let count = usize::try_from(1 + random.below(MODULES_MAX)).unwrap_or(1);
            processes.push(left.split_off(left.len().saturating_sub(count)));
        }
    }
    processes
}

/// What a fault does to the process of a module, or its links, if anything.
fn treatment_of(module: ModuleId, fault: &Fault) -> Option<Fault> {
    let itself = |of: &ModuleId| (*of == module).then_some(ITSELF);
    match fault {
        Fault::Crash(of) => itself(of).map(Fault::Crash),
        Fault::Restart(of) => itself(of).map(Fault::Restart),
        Fault::StartLate(of) => itself(of).map(Fault::StartLate),
        Fault::SetClock(of, ahead) => itself(of).map(|of| Fault::SetClock(of, *ahead)),
        Fault::Pause(of, span) => itself(of).map(|of| Fault::Pause(of, *span)),
        Fault::Suspend(of, span) => itself(of).map(|of| Fault::Suspend(of, *span)),
        Fault::Slow { module, lag, span } => itself(module).map(|module| Fault::Slow {
            module,
            lag: *lag,
            span: *span,
        }),
        Fault::Cut(aside) => {
            let is_aside = aside.contains(&module).then_some(ITSELF);
            Some(Fault::Cut(is_aside.into_iter().collect()))
        }
        Fault::Sever(links) => {
            let seen = |end: &ModuleId| itself(end).unwrap_or(*end);
            let severed = links
                .iter()
                .filter(|(from, to)| [from, to].contains(&&module));
            let severed: BTreeSet<_> = severed.map(|(from, to)| (seen(from), seen(to))).collect();
            Some(Fault::Sever(severed))
        }
        // A module that is gone for good may leave its process behind.
        Fault::Remove { module: of, .. } => (*of == module).then(|| fault.clone()),
        Fault::Heal
        | Fault::Command(..)
        | Fault::Stop(_)
        | Fault::Drive { .. }
        | Fault::SilentDriver(_)
        | Fault::Carry { .. }
        | Fault::Mislead(..)
        | Fault::ForgeClaims
        | Fault::ForgeRoster
        | Fault::Withdraw
        | Fault::Announce(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modules(ids: &[u32]) -> BTreeSet<ModuleId> {
        ids.iter().copied().map(ModuleId).collect()
    }

    #[test]
    fn modules_that_a_fault_treats_otherwise_share_no_process() {
        let at = Duration::from_secs(1);
        let faults = [
            Fault::Crash(ModuleId(1)),
            Fault::Cut(modules(&[2, 3])),
            Fault::Sever([(ModuleId(4), ModuleId(5))].into()),
            Fault::Pause(ModuleId(6), at),
            Fault::Pause(ModuleId(7), at),
        ];
        let faults = faults.map(|fault| ScheduledFault { at, fault });
        let all: Vec<ModuleId> = (1..=12).map(ModuleId).collect();
        let mut shared = BTreeSet::new();
        for seed in 0..200 {
            let mut random = Random::from_seed(seed);
            let processes = draw_processes(&faults, &all, |module| module.0 == 12, &mut random);
            let hosted: usize = processes.iter().map(Vec::len).sum();
            assert_eq!(hosted, all.len());
            for process in processes {
                assert!(process.len() <= 4);
                let process: BTreeSet<ModuleId> = process.into_iter().collect();
                let several = Some(process).filter(|process| process.len() > 1);
                shared.extend(several);
            }
        }
        let may_share = [modules(&[2, 3]), modules(&[6, 7]), modules(&[8, 9, 10, 11])];
        let is_allowed =
            |process: &BTreeSet<ModuleId>| may_share.iter().any(|alike| process.is_subset(alike));
        assert!(shared.iter().all(is_allowed), "{shared:?}");
        assert!(may_share.iter().all(|alike| shared.contains(alike)));
    }
}
