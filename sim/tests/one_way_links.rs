//! Links that carry nothing, mostly in one direction only: who forms is the largest set of modules that all receive each other.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_generate::{Grouping, Random};
use formation_model::{ModuleId, ModulePhase, Roster};

use crate::support::{Trial, drawn_beside, hold_a_plan};

/// How long after the last change of links a roster is to be in force in all but few runs, and in all.
const SOON: Duration = Duration::from_secs(60);
const LIMIT: Duration = Duration::from_secs(300);

/// The links between the modules of a run that carry nothing, and when they fail.
struct Drawn {
    modules: u32,
    links: BTreeSet<(ModuleId, ModuleId)>,
    /// Whether all modules form first.
    fail_later: bool,
}

impl Drawn {
    fn from_seed(seed: u64) -> Self {
        let mut random = Random::from_seed(seed);
        let modules = 5 + u32::try_from(random.below(12)).unwrap();
        let count = 1 + random.below(5);
        let mut module = || ModuleId(1 + u32::try_from(random.below(u64::from(modules))).unwrap());
        let links = (0..count).map(|_| (module(), module()));
        let links = links.filter(|(from, to)| from != to).collect();
        let fail_later = random.below(2) == 0;
        Self {
            modules,
            links,
            fail_later,
        }
    }

    fn all(&self) -> Vec<ModuleId> {
        (1..=self.modules).map(ModuleId).collect()
    }

    /// The size of the largest sets without the ends of a failed link: by looking at all subsets of the ends.
    fn largest(&self) -> usize {
        let links = self.links.iter().flat_map(|&(from, to)| [from, to]);
        let ends: Vec<ModuleId> = links.collect::<BTreeSet<_>>().into_iter().collect();
        let fewest_out = (0_u32..1 << ends.len()).filter(|out| {
            let is_out = |module: &ModuleId| {
                let index = ends.iter().position(|end| end == module);
                index.is_some_and(|index| out >> index & 1 == 1)
            };
            self.links
                .iter()
                .all(|(from, to)| is_out(from) || is_out(to))
        });
        let fewest_out = fewest_out.map(u32::count_ones).min().unwrap();
        (self.modules - fewest_out) as usize
    }
}

/// The number of members of the roster that is in force and that these links do not end, if one is.
fn in_force(trial: &Trial, drawn: &Drawn, has_failed: bool) -> Option<usize> {
    use ModulePhase::{Moving, Settled, Spare, Waiting};
    let standings = drawn.all().into_iter();
    let standings = standings.filter_map(|module| Some((module, trial.cluster.standing(module)?)));
    let agreed: Vec<_> = standings
        .filter(|(_, one)| matches!(one.phase, Waiting | Moving | Settled | Spare))
        .filter_map(|(module, one)| Some((module, one.epoch?, one.digest?)))
        .collect();
    let is_whole = |&(from, to): &(ModuleId, ModuleId), roster: &Roster| {
        roster.member(from).is_none() || roster.member(to).is_none()
    };
    let can_hold = |roster: &Roster| drawn.links.iter().all(|link| is_whole(link, roster));
    let rosters = trial.rosters.iter().rev();
    let rosters = rosters.filter(|roster| !has_failed || can_hold(roster));
    let mut sizes = rosters.filter_map(|roster| {
        let shows = |module| {
            let of_epoch = agreed.iter().find(|(one, ..)| *one == module);
            of_epoch.filter(|(_, epoch, _)| *epoch == roster.epoch)
        };
        let shown = roster.members.iter().map(|member| shows(member.module.id));
        let shown: Option<Vec<_>> = shown.collect();
        let digests: BTreeSet<_> = shown?.iter().map(|(.., digest)| *digest).collect();
        (digests.len() == 1).then_some(roster.members.len())
    });
    sizes.next()
}

/// How long it takes until a roster is in force, and until one of the largest set is.
fn times(drawn_links: &Drawn, seed: u64) -> (Option<Duration>, Option<Duration>) {
    let count = drawn_links.modules as usize;
    let mut trial = Trial::new(&drawn_beside(count, count, Grouping::Mixed, seed), seed);
    if drawn_links.fail_later {
        let mut whole = false;
        while !whole {
            trial.run_for(Duration::from_secs(1));
            whole = in_force(&trial, drawn_links, false) == Some(count);
            assert!(trial.cluster.now() < LIMIT, "seed {seed}");
        }
    }
    trial.cluster.sever(&drawn_links.links);
    let from = trial.cluster.now();
    let (mut first, mut best) = (None, None);
    while best.is_none() && trial.cluster.now() < from + LIMIT {
        trial.run_for(Duration::from_millis(500));
        let after = trial.cluster.now() - from;
        let size = in_force(&trial, drawn_links, true);
        if size.is_some() {
            first = first.or(Some(after));
        }
        if size == Some(drawn_links.largest()) {
            best = Some(after);
        }
    }
    (first, best)
}

/// Runs this many drawn sets of links; returns in how many a roster of the largest set is in force soon.
fn run(seeds: std::ops::Range<u64>) -> (u64, u64, u64) {
    let (mut soon, mut largest, mut all) = (0, 0, 0);
    for seed in seeds {
        let links = Drawn::from_seed(seed);
        if links.largest() * 2 <= links.modules as usize {
            continue;
        }
        let (first, best) = times(&links, seed);
        all += 1;
        soon += u64::from(first.is_some_and(|at| at <= SOON));
        largest += u64::from(best.is_some());
        if best.is_none_or(|at| at > SOON) {
            println!(
                "seed {seed}: {} modules, without {:?}, later {}: in force {first:?}, largest {best:?}",
                links.modules, links.links, links.fail_later
            );
        }
    }
    (soon, largest, all)
}

/// Module 10 never starts, so that the first gathering waits for it; module 2 does not receive module 1, and does not convene as well.
/// Shows E4, G2.
#[test]
fn who_is_left_out_does_not_convene_while_others_wait_for_a_module_that_is_not_there() {
    let mut trial = Trial::new(&drawn_beside(10, 10, Grouping::Singletons, 1), 1);
    trial
        .cluster
        .start_late(ModuleId(10), Duration::from_secs(3_600));
    trial.cluster.sever(&[(ModuleId(1), ModuleId(2))].into());
    let members: BTreeSet<ModuleId> = [1, 3, 4, 5, 6, 7, 8, 9].map(ModuleId).into();
    trial.run_for(Duration::from_secs(90));
    assert!(hold_a_plan(&trial.cluster, &members));
    // Until all have listened for `suspicion`, no one can know.
    assert!(trial.convened.len() <= 3, "{}", trial.convened.len());
}

/// Shows E6, E7.
#[test]
fn the_largest_set_that_receives_each_other_forms() {
    let seeds = std::env::var("FORMATION_SEEDS").map_or(60, |text| text.parse().unwrap());
    let (soon, largest, all) = run(0..seeds);
    println!("{soon} of {all} in force soon, {largest} of the largest set");
    assert!(soon * 200 >= all * 199, "{soon} of {all} in force soon");
    assert_eq!(largest, all, "of the largest set");
}
