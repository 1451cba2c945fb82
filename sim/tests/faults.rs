//! Runs with faults: crashes, restarts, cuts, slow processes, rough networks.
//!
//! The seeds that are named here once failed. A change of the protocol changes all schedules, after which a seed need not meet the
//! same case any more; the seeds that must are those of `mutations.rs`.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::time::Duration;

use formation_sim::{CampaignParameters, FaultKind};

use crate::support::{run_all, run_each};

/// The number of seeds; `tests/soak_simulation.sh` runs more.
fn seeds() -> u64 {
    std::env::var("FORMATION_SEEDS").map_or(250, |text| text.parse().unwrap())
}

#[test]
fn faults_while_plans_are_computed_leave_no_hole() {
    for faults in [FaultKind::Mixed, FaultKind::Hostile] {
        let parameters = CampaignParameters {
            faults,
            modules_max: 12,
            // Longer than `suspicion_s` and `stuck_s`.
            plan_time_max: Some(Duration::from_secs(12)),
            ..CampaignParameters::default()
        };
        run_all(&parameters, 0..seeds() / 8);
    }
}

/// Shows G1.
#[test]
fn mixed_faults_leave_no_hole() {
    run_all(&CampaignParameters::default(), 0..seeds() / 5);
}

#[test]
fn crashes_alone_leave_no_hole() {
    let parameters = CampaignParameters {
        faults: FaultKind::Crash,
        ..CampaignParameters::default()
    };
    run_all(&parameters, 0..seeds() / 20);
}

#[test]
fn cuts_alone_leave_no_hole() {
    let parameters = CampaignParameters {
        faults: FaultKind::Partition,
        ..CampaignParameters::default()
    };
    run_all(&parameters, 0..seeds() / 20);
}

/// Shows M6, G4.
#[test]
fn hostile_faults_leave_no_hole() {
    let parameters = CampaignParameters {
        faults: FaultKind::Hostile,
        modules_max: 16,
        ..CampaignParameters::default()
    };
    run_all(&parameters, 0..seeds() / 20);
}

#[test]
fn churn_leaves_no_hole_and_no_module_alone() {
    for faults in [FaultKind::Churn, FaultKind::Clocks] {
        for modules_max in [4, 9] {
            let parameters = CampaignParameters {
                faults,
                modules_min: 2,
                modules_max,
                ..CampaignParameters::default()
            };
            run_all(&parameters, 0..seeds());
        }
    }
}

/// Seeds with a goal of the instant in which its sender leaves the plan, and with an outsider that reaches only a later run of
/// a member: the goal is withdrawn, and the outsider reports that it waits for a quorum.
/// Shows Q6, A7.
#[test]
fn goals_end_with_their_plan_and_all_say_that_they_wait() {
    let parameters = CampaignParameters {
        faults: FaultKind::Hostile,
        modules_max: 16,
        ..CampaignParameters::default()
    };
    for seed in [2_991, 5_082] {
        run_all(&parameters, seed..seed + 1);
    }
}

/// Seeds with a state that arrives while its sender's earlier run still counts as live, and with a target that changes between
/// freezing and the roster: neither leaves a quorum waiting for itself. In the last, the convener cannot learn of the latest
/// roster, as the only module that was in that one and in its own has restarted without a store.
/// Shows M3, G5, G6.
#[test]
fn a_quorum_does_not_wait_for_itself() {
    run_each(FaultKind::Mixed, [2, 12], &[110_000_241]);
    for seed in [
        1_417, 2_241, 2_276, 3_664, 4_576, 4_796, 5_423, 6_787, 9_595, 9_728,
    ] {
        run_all(&CampaignParameters::default(), seed..seed + 1);
    }
}

/// Seeds with a goal that waits for the store while its module arrives: the module would set off again. And one in which bodies
/// may stand on every spot.
#[test]
fn no_goal_outlives_an_arrival() {
    let seeds = [20_001_547, 20_002_328, 20_011_259];
    run_each(FaultKind::Hostile, [2, 12], &seeds);
}

/// Seeds in which a group has no quorum, and bodies may stand on every spot; in the last, the only module that gathers is
/// retired. The group reports that it waits for a quorum.
#[test]
fn a_group_without_a_quorum_says_so_even_if_nothing_could_be_planned() {
    let seeds = [51_000_097, 51_000_872, 51_000_938, 51_002_518, 90_007_223];
    run_each(FaultKind::Mixed, [2, 12], &seeds);
}

/// A module of a group restarts while it is cut off from the publisher, so that the group waits for a quorum, or has formed, without
/// it.
#[test]
fn what_no_rule_can_know_is_not_held_against_the_modules() {
    let seeds = [70_007_073, 70_013_767, 90_005_940];
    run_each(FaultKind::Mixed, [2, 12], &seeds);
}

/// In the first seed, an absent body may stand on every spot, although its module still counts as live: the convener's state
/// lists it. In the second, pinned modules fill all that is connected to them, and a larger part is cut off. In the third, a cut
/// that lasts keeps a later target from a module for which bodies cover the whole former one.
#[test]
fn bodies_that_leave_no_room_are_listed() {
    let seeds = [90_016_624, 90_003_717, 160_001_188];
    run_each(FaultKind::Mixed, [2, 12], &seeds);
}

/// In the first and the fourth hostile seed, the drive of one module fails while the modules docked to it move: they halt. In the
/// second, a member pauses between having the whole plan and showing it, and waits for that roster's majority. In the third, a
/// convener without a quorum refuses the later roster of others, and calls them. In the last, a process that was paused repeats a
/// goal at which its module has arrived meanwhile. In the rest, bodies stay where their modules crashed on paths, in passing
/// settled modules, or are put back by a restart. In the first of those with five modules or more, a body stands where the members
/// know and the convener does not; in the others, a driver falls silent on its way: its module shows no place in later epochs, and
/// counts for no majority. In the last but one, a module crashed while it turned. In the last, a block that was halted out of line
/// stands next to a module that was docked to one that failed.
/// Shows A3.
#[test]
fn modules_that_fail_or_crash_on_their_way_lead_to_no_contact() {
    let seeds = [50_001_993, 50_002_332, 60_001_552, 100_019_419, 30_002_089];
    run_each(FaultKind::Hostile, [2, 12], &seeds);
    let seeds = [
        51_000_168, 51_000_680, 51_001_600, 51_001_916, 51_002_120, 51_002_161,
    ];
    run_each(FaultKind::Mixed, [2, 12], &seeds);
    let seeds = [53_002_973, 54_009_264, 54_011_057];
    run_each(FaultKind::Hostile, [5, 12], &seeds);
    run_each(FaultKind::Hostile, [2, 12], &[81_000_746, 77_013_560]);
}
