//! Hands push and carry modules, and localisation jumps: a robot is where it is measured.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{MicroUnits, ModuleId, ModulePhase, PlanningProblem};
use formation_protocol::{EpochReason, Event};
use formation_sim::{
    CampaignParameters, CarryMoment, Cluster, ClusterParameters, Ending, FaultKind, SeedReport,
    Stores, ViolationKind, Way, run_seed, run_seeds,
};

use crate::support::{Trial, ids, scenario, waiting_for_a_lease};

/// Bodies are 0.9 units wide.
const WIDTH: f64 = 0.9;

/// Six modules that go one after another through the same row of cells to a row of spots.
fn in_a_row() -> PlanningProblem {
    scenario(
        "target: {map: 'o-o-o-o-o-o'}\n\
         singletons:\n\
         - {id: 1, x: 10, y: 0}\n\
         - {id: 2, x: 12, y: 0}\n\
         - {id: 3, x: 14, y: 0}\n\
         - {id: 4, x: 16, y: 0}\n\
         - {id: 5, x: 18, y: 0}\n\
         - {id: 6, x: 20, y: 0}\n",
    )
}

fn way(x: f64, y: f64) -> Way {
    (
        MicroUnits::from_units(x).unwrap(),
        MicroUnits::from_units(y).unwrap(),
    )
}

fn moves(cluster: &Cluster, module: ModuleId) -> bool {
    cluster
        .standing(module)
        .is_some_and(|standing| standing.moving)
}

fn phase(cluster: &Cluster, module: ModuleId) -> Option<ModulePhase> {
    Some(cluster.standing(module)?.phase)
}

/// Two modules whose bodies, all along the axes, overlap.
fn contact(cluster: &Cluster) -> Option<(ModuleId, ModuleId)> {
    let modules: Vec<ModuleId> = cluster.modules().into_iter().collect();
    let overlaps = |one: ModuleId, other: ModuleId| {
        let (one, other) = (cluster.body(one).unwrap(), cluster.body(other).unwrap());
        let (x, y) = (one.x.0 - other.x.0, one.y.0 - other.y.0);
        let apart = MicroUnits(x.abs().max(y.abs()));
        apart.to_units() < WIDTH - 0.001
    };
    let pairs = modules
        .iter()
        .flat_map(|&one| modules.iter().map(move |&other| (one, other)));
    pairs
        .filter(|(one, other)| one < other)
        .find(|&(one, other)| overlaps(one, other))
}

fn displaced(trial: &Trial) -> Vec<(ModuleId, MicroUnits)> {
    let reasons = trial.noted.iter().filter_map(|(_, event)| match event {
        Event::Convened(_, EpochReason::Displaced(displaced)) => Some(displaced.clone()),
        _ => None,
    });
    reasons.flatten().collect()
}

/// A module is pushed off its way into that of the module behind it, which would drive through it.
/// Shows X14, E3.
#[test]
fn a_module_that_is_pushed_on_its_way_is_not_run_into_and_goes_on_from_where_it_stands() {
    let mut trial = Trial::new(&in_a_row(), 1);
    let pushed = ModuleId(2);
    trial.until(|cluster| moves(cluster, pushed) && moves(cluster, ModuleId(1)));
    assert!(trial.cluster.carry(pushed, false, way(0.0, 2.5)));
    trial.until(|cluster| {
        let met = contact(cluster);
        assert_eq!(met, None, "{}", cluster.transcript());
        cluster.has_formed() && crate::support::newest_epoch(cluster) > 1
    });
    let found = displaced(&trial);
    assert!(
        found
            .iter()
            .any(|&(module, off)| module == pushed && off.to_units() > 1.0)
    );
    assert_eq!(trial.settled().len(), 6);
}

/// One that waits for others to leave its way is pushed into that of another.
/// Shows X14.
#[test]
fn a_module_that_is_pushed_while_it_waits_is_not_run_into() {
    let mut trial = Trial::new(&in_a_row(), 1);
    let waits = |cluster: &Cluster, module| {
        phase(cluster, module) == Some(ModulePhase::Moving) && !moves(cluster, module)
    };
    let mut pushed = None;
    trial.until(|cluster| {
        let mut modules = cluster.running().into_iter();
        pushed = modules.find(|&module| waits(cluster, module));
        pushed.is_some()
    });
    let pushed = pushed.unwrap();
    assert!(trial.cluster.carry(pushed, false, way(-2.0, 0.0)));
    trial.until(|cluster| {
        let met = contact(cluster);
        assert_eq!(met, None, "{}", cluster.transcript());
        cluster.has_formed() && crate::support::newest_epoch(cluster) > 1
    });
    assert!(
        displaced(&trial)
            .iter()
            .any(|&(module, _)| module == pushed)
    );
}

/// Shows E3, P1.
#[test]
fn a_settled_module_that_is_pushed_off_its_spot_goes_back() {
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(Cluster::has_formed);
    let spot = trial.spot_of(ModuleId(6));
    let stood = trial.cluster.body(ModuleId(6)).unwrap();
    assert!(trial.cluster.carry(ModuleId(6), false, way(0.0, 1.5)));
    trial.until_formed_again();
    assert_eq!(displaced(&trial), [(ModuleId(6), way(0.0, 1.5).1)]);
    assert_eq!(trial.spot_of(ModuleId(6)), spot);
    assert_eq!(trial.cluster.body(ModuleId(6)).unwrap(), stood);
    let first = trial.convened.len();
    trial.run_for(Duration::from_secs(60));
    assert_eq!(trial.convened.len(), first, "no further epoch");
}

/// The links of the docked part last all the time.
#[test]
fn a_docked_part_that_is_moved_as_a_whole_goes_back_as_one_block() {
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(Cluster::has_formed);
    trial.run_for(Duration::from_secs(1));
    let stood: Vec<_> = ids(&[1, 2, 3, 4, 5, 6])
        .into_iter()
        .map(|module| (module, trial.cluster.body(module)))
        .collect();
    let links = |cluster: &Cluster| -> Vec<BTreeSet<ModuleId>> {
        let modules = cluster.modules().into_iter();
        modules
            .map(|module| cluster.links(module).unwrap().clone())
            .collect()
    };
    let docked = links(&trial.cluster);
    assert!(trial.cluster.carry(ModuleId(3), true, way(0.4, 3.3)));
    let before = trial.newest_epoch();
    trial.until(|cluster| {
        assert_eq!(links(cluster), docked);
        cluster.has_formed() && crate::support::newest_epoch(cluster) > before
    });
    for (module, pose) in stood {
        assert_eq!(trial.cluster.body(module), pose, "{module}");
    }
}

/// On its way, a body that is wider by two standard deviations on each side must not reach out of its cells: bodies 0.9 units wide
/// leave 0.05. Where it is measured meanwhile is not believed.
/// Shows X15.
#[test]
fn a_module_whose_driver_states_too_great_a_deviation_halts_with_all_others_until_that_is_less() {
    let module = ModuleId(3);
    let is_lost = |event: &Event| matches!(event, Event::LocalisationLost(_));
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(|cluster| moves(cluster, module));
    trial.cluster.state_deviation(module, MicroUnits(24_000));
    trial.run_for(Duration::from_millis(200));
    assert_eq!(trial.count(is_lost), 0);
    trial.cluster.state_deviation(module, MicroUnits(26_000));
    trial.cluster.mislead(module, way(0.0, 0.4));
    trial.run_for(Duration::from_secs(1));
    let stood: Vec<_> = trial.cluster.modules().into_iter().collect();
    let poses =
        |trial: &Trial| -> Vec<_> { stood.iter().map(|&it| trial.cluster.body(it)).collect() };
    let before = poses(&trial);
    trial.run_for(Duration::from_secs(20));
    assert_eq!(poses(&trial), before, "a module moved");
    trial.cluster.mislead(module, Way::default());
    trial.cluster.state_deviation(module, MicroUnits(10_000));
    trial.until(Cluster::has_formed);
    assert_eq!(trial.count(is_lost), 1);
    assert_eq!(trial.count(|event| *event == Event::BackOnPath), 1);
    assert_eq!(trial.convened.len(), 1);
}

/// Nor does it leave its spot for where it is measured meanwhile.
#[test]
fn a_settled_module_halts_beyond_the_limit_for_the_deviation_and_stays() {
    let module = ModuleId(6);
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(Cluster::has_formed);
    let stood = trial.cluster.body(module);
    for (deviation, lost) in [(100_000, 0), (100_001, 1)] {
        trial.cluster.state_deviation(module, MicroUnits(deviation));
        trial.cluster.mislead(module, way(0.0, 0.01));
        trial.run_for(Duration::from_secs(1));
        let events = trial.count(|event| matches!(event, Event::LocalisationLost(_)));
        assert_eq!(events, lost);
    }
    trial.cluster.mislead(module, way(3.0, 0.2));
    trial.run_for(Duration::from_secs(30));
    assert_eq!(trial.cluster.body(module), stood);
    assert_eq!(trial.convened.len(), 1);
    trial.cluster.state_deviation(module, MicroUnits(0));
    trial.cluster.mislead(module, Way::default());
    trial.run_for(Duration::from_secs(1));
    assert!(trial.cluster.has_formed());
}

/// The one that is torn off within the step that it takes goes on, and docks again where both end.
#[test]
fn a_docked_pair_that_is_torn_apart_on_its_way_ends_docked() {
    let problem = scenario(
        "target: {map: 'o-o'}\n\
         configurations:\n\
         - id: 1\n  \
           leader: 1\n  \
           modules: [{id: 1, x: 12, y: 0}, {id: 2, x: 13, y: 0}]\n  \
           edges: [[1, 2]]\n",
    );
    for ahead in [-0.3, -0.1] {
        let mut trial = Trial::new(&problem, 1);
        trial.until(|cluster| {
            cluster
                .body(ModuleId(1))
                .is_some_and(|pose| pose.x.to_units() < 7.0)
        });
        // A few hundredths into a step of one cell.
        trial.run_for(Duration::from_millis(20));
        assert!(trial.cluster.carry(ModuleId(1), false, way(ahead, 0.0)));
        trial.until(Cluster::has_formed);
        trial.run_for(Duration::from_secs(10));
        assert_eq!(trial.convened.len(), 1, "{}", trial.cluster.transcript());
        for (module, other) in [(1, 2), (2, 1)] {
            let links = trial.cluster.links(ModuleId(module)).unwrap();
            assert_eq!(*links, ids(&[other]), "{module}, {ahead}");
        }
    }
}

/// The request waits for the store, and the ports of the simulator reach so far.
#[test]
fn a_module_that_is_pushed_when_it_has_asked_its_ports_to_dock_asks_again_when_it_is_back() {
    let parameters = ClusterParameters {
        stores: Stores::All,
        write_max: Duration::from_millis(800),
        ..ClusterParameters::default()
    };
    let mut asked = 0;
    for seed in 0..10 {
        let mut trial = Trial::with(&in_a_row(), parameters, seed);
        let module = ModuleId(6);
        trial.until(Cluster::has_formed);
        let spot = trial.cluster.body(module);
        let is_docked = |cluster: &Cluster| cluster.links(module).is_some_and(|it| !it.is_empty());
        assert!(trial.cluster.carry(module, false, way(0.0, 3.0)));
        trial.until(|cluster| cluster.body(module) == spot);
        asked += usize::from(!is_docked(&trial.cluster));
        assert!(trial.cluster.carry(module, false, way(0.0, 1.5)));
        let before = trial.newest_epoch();
        trial.until(|cluster| {
            cluster.has_formed() && crate::support::newest_epoch(cluster) > before
        });
        let contradicted = |event: &Event| matches!(event, Event::PortsContradictPose(_));
        assert_eq!(trial.count(contradicted), 0, "{seed}");
    }
    assert!(asked >= 5, "{asked}");
}

/// It is no push if its ports are locked to modules that stand on their spots.
/// Shows X15.
#[test]
fn a_settled_module_that_is_measured_elsewhere_than_its_ports_say_stays() {
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(Cluster::has_formed);
    let stood = trial.cluster.body(ModuleId(3));
    trial.cluster.mislead(ModuleId(3), way(0.0, 0.7));
    trial.run_for(Duration::from_secs(30));
    let off = way(0.0, 0.7).1;
    assert_eq!(
        trial.count(|event| *event == Event::PortsContradictPose(off)),
        1
    );
    trial.cluster.mislead(ModuleId(3), Way::default());
    trial.run_for(Duration::from_secs(30));
    assert_eq!(trial.count(|event| *event == Event::BackOnPath), 1);
    assert_eq!(trial.convened.len(), 1);
    assert_eq!(trial.cluster.body(ModuleId(3)), stood);
    assert!(trial.cluster.has_formed());
}

/// Shows X14.
#[test]
fn localisation_that_jumps_and_returns_within_a_second_only_halts() {
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(|cluster| moves(cluster, ModuleId(4)));
    trial.cluster.mislead(ModuleId(4), way(-3.0, 0.5));
    trial.run_for(Duration::from_secs(1));
    assert!(
        ids(&[1, 2, 3, 4, 5, 6])
            .into_iter()
            .all(|module| !moves(&trial.cluster, module))
    );
    trial.cluster.mislead(ModuleId(4), Way::default());
    trial.until(|cluster| {
        assert_eq!(contact(cluster), None);
        cluster.has_formed()
    });
    assert_eq!(trial.convened.len(), 1);
}

/// What it may drive to lies where it is measured, but it has not set off.
/// Shows X14.
#[test]
fn a_module_that_is_measured_ahead_before_it_sets_off_does_not_set_off() {
    let mut trial = Trial::with(&in_a_row(), waiting_for_a_lease(), 1);
    trial.until(|cluster| phase(cluster, ModuleId(6)) == Some(ModulePhase::Waiting));
    let stood = trial.cluster.body(ModuleId(6)).unwrap();
    trial.cluster.mislead(ModuleId(6), way(-1.0, 0.0));
    trial.run_for(Duration::from_millis(1_500));
    assert_eq!(trial.count(|event| matches!(event, Event::OffPath(_))), 1);
    assert_eq!(trial.cluster.body(ModuleId(6)), Some(stood));
    trial.cluster.mislead(ModuleId(6), Way::default());
    trial.until(|cluster| {
        assert_eq!(contact(cluster), None);
        cluster.has_formed()
    });
    assert_eq!(trial.convened.len(), 1);
}

/// A neighbour docks to a settled module while that is measured elsewhere.
/// Shows X2, X14.
#[test]
fn links_that_a_neighbour_reported_count_once_the_module_is_measured_on_its_spot() {
    let mut trial = Trial::new(&in_a_row(), 1);
    let settled = |cluster: &Cluster| {
        let modules = ids(&[1, 2, 3, 4, 5, 6]).into_iter();
        let settled: Vec<ModuleId> = modules
            .filter(|&module| phase(cluster, module) == Some(ModulePhase::Settled))
            .collect();
        settled
    };
    trial.until(|cluster| !settled(cluster).is_empty());
    let first = settled(&trial.cluster)[0];
    trial.cluster.mislead(first, way(0.0, 0.4));
    trial.run_for(Duration::from_millis(600));
    trial.cluster.mislead(first, Way::default());
    trial.until(Cluster::has_formed);
    trial.run_for(Duration::from_secs(5));
    for module in ids(&[1, 2, 3, 4, 5, 6]) {
        let links = trial.cluster.links(module).unwrap().clone();
        for link in links {
            let back = trial.cluster.links(link).unwrap();
            assert!(back.contains(&module), "{link} to {module}");
        }
    }
}

/// The ports that are locked to it no longer say where it is.
/// Shows X15.
#[test]
fn a_structure_that_is_shoved_after_one_of_it_was_not_believed_goes_back_as_a_whole() {
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(Cluster::has_formed);
    let module = ModuleId(3);
    trial.cluster.mislead(module, way(0.0, 0.7));
    trial.run_for(Duration::from_secs(5));
    assert_eq!(
        trial.count(|event| matches!(event, Event::PortsContradictPose(_))),
        1
    );
    // A new epoch, in which it is still not believed.
    assert!(trial.cluster.carry(ModuleId(6), false, way(0.0, 2.0)));
    trial.run_for(Duration::from_secs(20));
    trial.cluster.mislead(module, Way::default());
    trial.until(Cluster::has_formed);
    trial.run_for(Duration::from_secs(5));
    let stood = trial.cluster.body(module);
    assert!(trial.cluster.carry(module, true, way(0.4, 3.3)));
    trial.until_formed_again();
    assert_eq!(trial.cluster.body(module), stood);
}

/// Its state is in the roster already that is being made.
/// Shows G3, X14.
#[test]
fn a_module_that_is_pushed_after_it_froze_is_planned_for_from_where_it_stands() {
    let mut trial = Trial::new(&in_a_row(), 1);
    trial.until(|cluster| phase(cluster, ModuleId(5)) == Some(ModulePhase::Agreeing));
    assert!(trial.cluster.carry(ModuleId(5), false, way(0.0, -2.0)));
    trial.until(|cluster| {
        assert_eq!(contact(cluster), None);
        cluster.has_formed()
    });
    assert_eq!(displaced(&trial), [(ModuleId(5), way(0.0, 2.0).1)]);
}

fn parameters(faults: FaultKind, moment: Option<CarryMoment>) -> CampaignParameters {
    CampaignParameters {
        faults,
        moment,
        modules_max: 24,
        fault_span: Duration::from_secs(20),
        transcripts: true,
        ..CampaignParameters::default()
    }
}

/// Whether a module was pushed to where no path begins: the others form without it, if they can.
fn is_in_a_pocket(report: &SeedReport) -> bool {
    report.transcript.events().contains("invalid_start")
}

fn seeds() -> u64 {
    std::env::var("FORMATION_SEEDS").map_or(30, |text| text.parse().unwrap())
}

#[test]
fn after_pushes_at_any_moment_all_are_whole_again_within_two_minutes() {
    for moment in CarryMoment::ALL {
        run_seeds(
            &parameters(FaultKind::Carried, Some(moment)),
            0..seeds(),
            |report| {
                let kinds: Vec<ViolationKind> =
                    report.violations.iter().map(|one| one.kind).collect();
                assert_eq!(
                    kinds,
                    [],
                    "{moment:?} {}: {:?}",
                    report.seed,
                    report.violations
                );
                if is_in_a_pocket(&report) {
                    return;
                }
                assert_eq!(report.ending, Ending::Formed);
                assert!(
                    report.recovery <= Duration::from_secs(120),
                    "{moment:?} {}",
                    report.seed
                );
            },
        )
        .unwrap();
    }
}

#[test]
fn localisation_that_jumps_leads_to_no_contact_and_no_false_verdict() {
    for seed in 0..seeds() {
        let report = run_seed(&parameters(FaultKind::Lost, None), seed).unwrap();
        assert_eq!(report.violations, [], "{seed}");
        assert_eq!(report.ending, Ending::Formed);
    }
}
