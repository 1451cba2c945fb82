//! Recovery when modules die, disagree or block each other, step by step.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::time::Duration;

use crate::support::{Trial, drawn, in_phase, newest_epoch, scenario, spots};
use formation_generate::Grouping;
use formation_model::{AssemblyWarning, ModuleId, ModulePhase};
use formation_protocol::{Agent, AgentParameters, Event, Mutation};
use formation_sim::{AgentFactory, Cluster, ClusterParameters, Standing};

/// Shows E3.
#[test]
fn a_spare_replaces_a_module_that_dies_on_its_way() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn(7, 6, Grouping::Singletons, seed), seed);
        trial.until(|cluster| !in_phase(cluster, ModulePhase::Moving).is_empty());
        let lost = trial.in_phase(ModulePhase::Moving)[0];
        trial.until_formed_without(&[lost]);
        let settled = trial.settled();
        assert_eq!(spots(&settled).len(), 6, "seed {seed}");
        assert_eq!(trial.open_spots(), None, "seed {seed}");
    }
}

/// Shows P2.
#[test]
fn without_a_spare_the_spot_of_a_module_that_died_settled_is_named_open() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn(6, 6, Grouping::Mixed, seed), seed);
        trial.until(Cluster::has_formed);
        let (lost, spot) = trial.settled()[1];
        trial.until_formed_without(&[lost]);
        assert_eq!(trial.open_spots(), Some(vec![spot]), "seed {seed}");
        assert_eq!(trial.settled().len(), 5, "seed {seed}");
    }
}

#[test]
fn what_is_left_of_a_half_moved_block_carries_on() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn(8, 8, Grouping::Configurations(4), seed), seed);
        // Two drives on their way at once are a block: units move one after another.
        let on_their_way = |cluster: &Cluster| {
            let moving = in_phase(cluster, ModulePhase::Moving);
            let driven = moving
                .into_iter()
                .filter(|&module| cluster.plan_in_motion(module).is_some());
            driven.collect::<Vec<_>>()
        };
        trial.until(|cluster| on_their_way(cluster).len() >= 3);
        let lost = on_their_way(&trial.cluster)[1];
        trial.until_formed_without(&[lost]);
        let settled = trial.settled();
        assert_eq!(spots(&settled).len(), 7, "seed {seed}");
        assert!(
            trial.open_spots().is_some_and(|open| open.len() == 1),
            "seed {seed}"
        );
    }
}

/// Shows A6.
#[test]
fn unequal_digests_bring_one_new_epoch_and_then_both_sides_are_named() {
    let problem = drawn(5, 5, Grouping::Singletons, 2);
    let agents = AgentFactory::new(|identity, parameters, now| {
        let odd = identity.module == ModuleId(4);
        let agent = Agent::new(identity, parameters, now);
        if odd {
            agent.mutated(Mutation::DifferentPlan)
        } else {
            agent
        }
    });
    let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), 2, agents);
    trial.run_for(Duration::from_secs(200));
    assert_eq!(trial.newest_epoch(), 2, "{}", trial.cluster.transcript());
    assert_eq!(trial.count(|event| matches!(event, Event::Agreed(_))), 0);
    assert_eq!(
        trial.count(|event| matches!(event, Event::MotionBegun(_))),
        0
    );
    let sides: Vec<_> = trial
        .noted
        .iter()
        .filter_map(|(_, event)| match event {
            Event::PlansDiffer(sides) => Some(
                sides
                    .iter()
                    .map(|(_, modules)| modules.clone())
                    .collect::<Vec<_>>(),
            ),
            _ => None,
        })
        .collect();
    let (odd, even) = (vec![ModuleId(4)], [1, 2, 3, 5].map(ModuleId).to_vec());
    assert_eq!(sides.len(), 5, "each member reports it once");
    assert!(
        sides
            .iter()
            .all(|sides| sides.len() == 2 && sides.contains(&odd) && sides.contains(&even))
    );
}

const SQUARE: &str = "
name: square
target:
  spots:
    - {id: 1, x: 20.0, y: 20.0, theta: 0.0}
    - {id: 2, x: 21.0, y: 20.0, theta: 0.0}
    - {id: 3, x: 22.0, y: 20.0, theta: 0.0}
    - {id: 4, x: 20.0, y: 21.0, theta: 0.0}
    - {id: 5, x: 21.0, y: 21.0, theta: 0.0}
    - {id: 6, x: 22.0, y: 21.0, theta: 0.0}
    - {id: 7, x: 20.0, y: 22.0, theta: 0.0}
    - {id: 8, x: 21.0, y: 22.0, theta: 0.0}
    - {id: 9, x: 22.0, y: 22.0, theta: 0.0}
  edges: [[1, 2], [2, 3], [4, 5], [5, 6], [7, 8], [8, 9], [1, 4], [4, 7], [2, 5], [5, 8], [3, 6], [6, 9]]
singletons:
  - {id: 1, x: 1.0, y: 1.0, theta: 0.0}
  - {id: 2, x: 3.0, y: 1.0, theta: 0.0}
  - {id: 3, x: 5.0, y: 1.0, theta: 0.0}
  - {id: 4, x: 7.0, y: 1.0, theta: 0.0}
  - {id: 5, x: 9.0, y: 1.0, theta: 0.0}
  - {id: 6, x: 1.0, y: 3.0, theta: 0.0}
  - {id: 7, x: 3.0, y: 3.0, theta: 0.0}
  - {id: 8, x: 5.0, y: 3.0, theta: 0.0}
  - {id: 9, x: 7.0, y: 3.0, theta: 0.0}
  - {id: 10, x: 9.0, y: 3.0, theta: 0.0}
";

/// Shows P3.
#[test]
fn settled_modules_that_wall_in_an_open_spot_make_way_outermost_first() {
    let problem = scenario(SQUARE);
    let mut trial = Trial::new(&problem, 5);
    trial.until(Cluster::has_formed);
    let centre = formation_model::SpotId(5);
    let (lost, _) = trial
        .settled()
        .into_iter()
        .find(|&(_, spot)| spot == centre)
        .unwrap();
    trial.noted.clear();
    trial.until_formed_without(&[lost]);
    assert_eq!(spots(&trial.settled()).len(), 9);
    let walled =
        |event: &Event| matches!(event, Event::AssemblyWarning(AssemblyWarning::WalledIn(_)));
    assert_eq!(trial.count(walled), 0, "{}", trial.cluster.transcript());
    let roster = trial.rosters.last().unwrap();
    let pinned: Vec<u32> = roster
        .members
        .iter()
        .filter_map(|member| Some(member.module.pin?.0))
        .collect();
    // The four corners and one side were released; three sides kept their pins.
    assert_eq!(pinned.len(), 3, "{pinned:?}");
    assert!(
        pinned.iter().all(|spot| [2, 4, 6, 8].contains(spot)),
        "{pinned:?}"
    );
}

/// Shows E8.
#[test]
fn a_higher_revision_of_the_same_target_opens_no_epoch() {
    let problem = drawn(5, 5, Grouping::Singletons, 1);
    let mut trial = Trial::new(&problem, 1);
    trial.until(Cluster::has_formed);
    trial.cluster.announce_problem(&problem, 2);
    trial.run_for(Duration::from_secs(60));
    assert_eq!(trial.newest_epoch(), 1);
    assert_eq!(trial.settled().len(), 5);
}

/// No module moves, so none of them is stuck.
#[test]
fn modules_that_only_plan_agree_again_without_one_that_dies() {
    let parameters = ClusterParameters {
        agent: AgentParameters {
            plan_only: true,
            ..AgentParameters::default()
        },
        ..ClusterParameters::default()
    };
    let mut trial = Trial::with(&drawn(6, 5, Grouping::Singletons, 2), parameters, 2);
    let agree = |cluster: &Cluster| {
        let running = cluster.running();
        let standings = running
            .iter()
            .filter_map(|&module| cluster.standing(module));
        let waits = |standing: Standing| {
            let phase = standing.phase;
            matches!(phase, ModulePhase::Waiting | ModulePhase::Spare).then_some(standing.digest)
        };
        let digests: Option<BTreeSet<_>> = standings.map(waits).collect();
        digests.is_some_and(|digests| digests.len() == 1)
    };
    trial.until(agree);
    trial.run_for(Duration::from_secs(300));
    assert_eq!(trial.newest_epoch(), 1, "{}", trial.cluster.transcript());
    let plan = trial.rosters.last().unwrap().members.clone();
    let lost = plan[1].module.id;
    trial.cluster.crash(lost);
    trial.until(|cluster| agree(cluster) && newest_epoch(cluster) > 1);
    trial.run_for(Duration::from_secs(300));
    assert_eq!(trial.newest_epoch(), 2, "{}", trial.cluster.transcript());
    for member in plan {
        let body = trial.cluster.body(member.module.id);
        assert_eq!(body, Some(member.module.pose));
    }
}

/// One of two neighbours restarts with the link to the other, which has forgotten it. Both stand on their spots and settle at the same
/// time, and neither has to dock to the other first: whichever state comes first, they end docked without another plan.
/// Shows X2.
#[test]
fn neighbours_that_restart_at_the_same_time_are_docked() {
    let starts = (0..6).map(|place| {
        let (x, y) = (place % 3, place / 3);
        format!("{{id: {}, x: {x}, y: {y}}}", place + 1)
    });
    let starts: Vec<String> = starts.collect();
    let target = r#"target: {map: "o-o-o\n| | |\no-o-o"}"#;
    let problem = scenario(&format!("{target}\nsingletons: [{}]", starts.join(", ")));
    for seed in 0..10 {
        for (one, other) in
            [(1, 2), (2, 1), (2, 5), (5, 2)].map(|(one, other)| (ModuleId(one), ModuleId(other)))
        {
            let mut trial = Trial::new(&problem, seed);
            trial.until(Cluster::has_formed);
            for lost in [one, other] {
                let before = trial.newest_epoch();
                trial.cluster.crash(lost);
                trial.until_formed_after(before);
            }
            let before = trial.newest_epoch();
            trial.cluster.restart(other);
            trial.cluster.restart(one);
            trial.until_formed_after(before);
            trial.until(|cluster| in_phase(cluster, ModulePhase::Settled).len() == 6);
            let epoch = trial.newest_epoch();
            trial.run_for(Duration::from_secs(2));
            assert_eq!(trial.newest_epoch(), epoch);
            for (own, its) in [(one, other), (other, one)] {
                let links = trial.cluster.links(own).unwrap();
                assert!(
                    links.contains(&its),
                    "seed {seed}: {own} is not docked to {its}: {links:?}"
                );
            }
        }
    }
}
