//! What the border refuses, and how it says so. Each case changes one thing in a message that is accepted.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use formation_model::{self as model, ModuleSize};
use formation_msgs as wire;
use formation_msgs::{IntoCore, NONE, PROTOCOL_VERSION, bounds};

/// The text of the refusal after `change`; the message must be accepted without it.
fn refusal<T, V>(valid: &T, change: impl FnOnce(&mut T)) -> String
where
    T: Clone + IntoCore<V>,
{
    assert!(valid.clone().into_core(ModuleSize::METRE).is_ok());
    let mut bad = valid.clone();
    change(&mut bad);
    match bad.into_core(ModuleSize::METRE) {
        Ok(_) => "accepted".to_owned(),
        Err(error) => error.to_string(),
    }
}

/// Names the table's type once: `refusals!(valid, Validated: message => change, "text"; ...)`.
macro_rules! refusals {
    ($valid:expr, $validated:ty: $($message:ident => $change:expr, $text:expr;)+) => {
        $(assert_eq!(
            refusal::<_, $validated>(&$valid, |$message| $change),
            $text
        );)+
    };
}

const EPOCH: wire::Epoch = wire::Epoch {
    number: 3,
    convener: 1,
};
const NO_EPOCH: wire::Epoch = wire::Epoch {
    number: 0,
    convener: 0,
};

fn mark(module_id: u32) -> wire::CausalMark {
    wire::CausalMark {
        module_id,
        sequence: 9,
    }
}

fn body(module_id: u32) -> wire::Body {
    wire::Body {
        module_id,
        incarnation: 3,
        whereabouts: wire::Body::WHEREABOUTS_SEEN,
        ..wire::Body::default()
    }
}

fn on_the_way(module_id: u32, path_micro: &[i64]) -> wire::Body {
    wire::Body {
        whereabouts: wire::Body::WHEREABOUTS_ON_THE_WAY,
        path_micro: path_micro.to_vec(),
        ..body(module_id)
    }
}

fn state() -> wire::ModuleState {
    wire::ModuleState {
        module_id: 4,
        incarnation: 1,
        knows: true,
        is_idle: false,
        last_plan: 0,
        sequence: 1,
        epoch: EPOCH,
        has_digest: true,
        digest: 7,
        phase: wire::ModuleState::PHASE_MOVING,
        service: wire::ModuleState::SERVICE_ACTIVE,
        stamp: wire::Time { sec: 5, nanosec: 6 },
        drive: wire::ModuleState::DRIVE_MOVING,
        x: 1.5,
        y: -2.0,
        theta: 0.0,
        links: vec![5, 6],
        configuration_id: 1,
        leader_id: 4,
        spot_id: 2,
        unit_id: 4,
        on_paths: true,
        steps_done: 3,
        settled_since: 0,
        waited_for: vec![mark(5), mark(1)],
        agreed_on: vec![mark(1)],
        removed_voters: vec![1, 4],
        listed_voters: vec![5],
        bodies: vec![body(7), body(9)],
        proposed_removals: vec![removal(7), removal(9)],
        refuted_removals: vec![removal(8)],
    }
}

fn removal(module_id: u32) -> wire::Removal {
    wire::Removal {
        module_id,
        incarnation: 3,
        takes_vote: true,
    }
}

#[test]
fn module_states() {
    let valid = wire::ModuleStates {
        header: wire::Header::default(),
        protocol_version: PROTOCOL_VERSION,
        session: 8,
        modules: vec![
            wire::ModuleState {
                module_id: 8,
                ..state()
            },
            state(),
        ],
        module_size: 1.0,
    };
    refusals!(valid, Vec<model::ModuleState>:
        sample => sample.module_size = 0.0,
            "module_states: module_size: is 0 m, but the modules of this node measure 1 m; give all nodes the same";
        sample => sample.header.frame_id = "m".repeat(256),
            "module_states: header.frame_id: 256 bytes, at most 255 are allowed";
        sample => sample.modules[1].module_id = 8, "module_states: modules[1]: module 8 is listed twice";
        sample => sample.modules[1].module_id = NONE,
            "module_states: modules[1].module_id: 4294967295 stands for none and cannot be used here";
        sample => sample.modules[1].epoch.convener = NONE,
            "module_states: modules[1].epoch.convener: 4294967295 stands for none and cannot be used here";
        sample => sample.modules[1].drive = 0,
            "module_states: modules[1].drive: 0 is unknown; known are STANDING 1, MOVING 2, FOLDING 3, DISPLACED 4, LOST 5";
        sample => sample.modules[1].stamp.sec = -1,
            "module_states: modules[1].stamp: needs sec >= 0 and nanosec < 10^9";
        sample => sample.modules[1].epoch = NO_EPOCH,
            "module_states: modules[1].digest: there cannot be one without an epoch";
        sample => sample.modules[1].has_digest = false,
            "module_states: modules[1].digest: must be 0 while has_digest is false";
        sample => { sample.modules[1].on_paths = false; },
            "module_states: modules[1].steps_done: must be 0 unless the module moves along a path";
        sample => { sample.modules[1].has_digest = false; sample.modules[1].digest = 0; },
            "module_states: modules[1].on_paths: must be false without a plan";
        sample => sample.modules[1].phase = 0,
            "module_states: modules[1].phase: 0 is unknown; known are LISTENING 1, GATHERED 2, PLANNING 3, AGREEING 4, \
             WAITING 5, MOVING 6, SETTLED 7, SPARE 8, WAITING_FOR_QUORUM 9, COMPUTING 10";
        sample => sample.modules[1].service = 0,
            "module_states: modules[1].service: 0 is unknown; known are ACTIVE 1, RETIRED 2, MOTION_FAILED 3";
        sample => sample.modules[1].x = f64::NAN,
            "module_states: modules[1].x: must be a finite number, got NaN";
        sample => sample.modules[1].y = f64::NEG_INFINITY,
            "module_states: modules[1].y: must be a finite number, got -inf";
        sample => sample.modules[1].theta = 1.0e6 + 0.5,
            "module_states: modules[1].theta: must lie within +-1000000, got 1000000.5";
        sample => sample.modules[1].links = vec![5, 4],
            "module_states: modules[1].links[1]: names module 4 itself";
        sample => sample.modules[1].links = vec![5, 6, 5],
            "module_states: modules[1].links[2]: module 5 is listed twice";
        sample => sample.modules[1].links = vec![NONE],
            "module_states: modules[1].links[0]: 4294967295 stands for none and cannot be used here";
        sample => sample.modules[1].links = (10..75).collect(),
            "module_states: modules[1].links: 65 entries, at most 64 are allowed";
        sample => sample.modules[1].settled_since = 2,
            "module_states: modules[1].settled_since: must be at most 1, got 2";
        sample => sample.modules[1].waited_for[1].module_id = 5,
            "module_states: modules[1].waited_for[1]: module 5 is listed twice";
        sample => sample.modules[1].agreed_on[0].module_id = NONE,
            "module_states: modules[1].agreed_on[0].module_id: 4294967295 stands for none and cannot be used here";
        sample => sample.modules[1].waited_for = vec![mark(1); bounds::MODULES_MAX + 1],
            "module_states: modules[1].waited_for: 10001 entries, at most 10000 are allowed";
        sample => sample.modules[1].agreed_on = vec![mark(1); bounds::MODULES_MAX + 1],
            "module_states: modules[1].agreed_on: 10001 entries, at most 10000 are allowed";
        sample => sample.modules[1].removed_voters = vec![4, 1],
            "module_states: modules[1].removed_voters[1]: module 4 must stand after module 1, the list ascends";
        sample => sample.modules[1].listed_voters = vec![5, 5],
            "module_states: modules[1].listed_voters[1]: module 5 is listed twice";
        sample => sample.modules[1].listed_voters = (0..=10_000).collect(),
            "module_states: modules[1].listed_voters: 10001 entries, at most 10000 are allowed";
        sample => sample.modules = vec![state(); bounds::MODULES_MAX + 1],
            "module_states: modules: 10001 entries, at most 10000 are allowed";
    );
    refusals!(state(), model::ModuleState:
        state => state.y = f64::NAN, "module_states: y: must be a finite number, got NaN";
    );
}

fn target() -> wire::TargetConfiguration {
    let spot = |id, x| wire::Spot {
        id,
        x,
        y: 0.0,
        theta: 0.0,
    };
    wire::TargetConfiguration {
        protocol_version: PROTOCOL_VERSION,
        voters: vec![1, 4],
        revision: 5,
        name: "pair".to_owned(),
        spots: vec![spot(1, 0.0), spot(2, 1.0)],
        edges: vec![wire::Edge {
            first: 1,
            second: 2,
        }],
        ..wire::TargetConfiguration::default()
    }
}

fn options(pairs: &[(&str, &str)]) -> Vec<wire::PolicyOption> {
    let option = |&(key, value): &(&str, &str)| wire::PolicyOption {
        key: key.to_owned(),
        value: value.to_owned(),
    };
    pairs.iter().map(option).collect()
}

#[test]
fn targets() {
    refusals!(target(), model::TargetAnnouncement:
        target => target.header.frame_id = "m".repeat(256),
            "target: header.frame_id: 256 bytes, at most 255 are allowed";
        target => target.name = "\u{20ac}".repeat(86), "target: name: 258 bytes, at most 255 are allowed";
        target => target.withdrawn = true, "target: spots: must be empty while the target is withdrawn";
        target => { target.withdrawn = true; target.spots.clear(); },
            "target: edges: must be empty while the target is withdrawn";
        target => target.expected_modules = 10_001, "target: expected_modules: must be at most 10000, got 10001";
        target => { target.spots.clear(); target.edges.clear(); }, "target: spots: the target needs at least one spot";
        target => target.spots[1].id = 1, "target: spots[1].id: spot 1 is used twice";
        target => target.spots[1].x = f64::INFINITY,
            "target: spots[1].x: must be a finite number, got inf (spot 2)";
        target => target.spots = vec![target.spots[0]; bounds::SPOTS_MAX + 1],
            "target: spots: 10001 entries; at most 10000 are supported";
        target => target.edges = vec![target.edges[0]; bounds::EDGES_MAX + 1],
            "target: edges: 40001 entries; at most 40000 are supported";
        target => target.edges[0].second = 9, "target: edges[0]: spot 9 is not in the target";
        target => target.edges.clear(),
            "target: edges: the target is disconnected; spot 2 cannot be reached from spot 1";
        target => target.planner.policy = "genetic".to_owned(),
            "target: planner.policy: `genetic` is unknown; known are exact, paper, auction, hungarian, given, nearest";
        target => target.planner.policy_options = options(&[("evicted", "lost")]),
            "target: planner.policy_options[0]: the policy `exact` has no options";
        target => {
            target.planner.policy = "paper".to_owned();
            target.planner.policy_options = options(&[("evicted", "lost"), ("colour", "red")]);
        },
            "target: planner.policy_options[1]: the policy `paper` of this version has no option `colour`; it has fallback, embedding, evicted, val, acting, max";
        target => {
            target.planner.policy = "paper".to_owned();
            target.planner.policy_options = options(&[("evicted", "worst")]);
        },
            "target: planner.policy_options[0]: `evicted` cannot be `worst`; it can be literal or lost";
        target => {
            target.planner.policy = "paper".to_owned();
            target.planner.policy_options = options(&[("max", "30"), ("max", "40")]);
        },
            "target: planner.policy_options[1].key: `max` is listed twice";
        target => target.planner.policy_options = vec![wire::PolicyOption::default(); 65],
            "target: planner.policy_options: 65 entries, at most 64 are allowed";
        target => target.planner.order = 2,
            "target: planner.order: 2 is unknown; known are RANK 0, SIZE_FIRST 1";
        target => target.planner.d_max = -2,
            "target: planner.d_max: -2 is unknown; known are 0 and above, and UNBOUNDED -1";
        target => target.planner.weight_dock = f64::NAN,
            "target: planner.weight_dock: must be a finite number, got NaN";
        target => target.planner.weight_loc = 101.0,
            "target: planner.weight_loc: must lie within +-100, got 101";
        target => target.planner.weight_undock = 0.5,
            "target: planner: must satisfy loc > dock > undock >= 0, got loc 1, dock 0.1, undock 0.5";
        target => target.module_size = 0.08,
            "target: module_size: is 0.08 m, but the modules of this node measure 1 m; give all nodes the same";
        target => target.module_size = f64::NAN,
            "target: module_size: is NaN m, but the modules of this node measure 1 m; give all nodes the same";
        target => target.obstacles = vec![area(0.0, 0.0)],
            "target: obstacles: spot 1 lies on the one around x 0, y 0";
        target => target.obstacles = vec![area(f64::NAN, 9.0)],
            "target: obstacles[0].x: must be a finite number, got NaN";
        target => target.obstacles = vec![area(9.0, 9.0); bounds::OBSTACLES_MAX + 1],
            "target: obstacles: 2001 entries, at most 2000 are allowed";
        target => target.arena = area(0.0, 0.0),
            "target: arena: spot 2 is beyond it";
        target => { target.planner.motion = wire::PlannerParameters::MOTION_STRAIGHT; },
            "target: planner.motion: 2 is unknown; known are AUTO 0 and PATHS 1, which are the same: modules move along paths only";
        target => target.body_width = 1.1,
            "target: body_width: must lie between 0.1 units and 1, the pitch of the lattice, got 1.1";
        target => target.planner.cut_price = -1.0,
            "target: planner.cut_price: must not be negative, got -1.000000";
        target => target.planner.spread = 1.5,
            "target: planner.spread: must lie between 0 and 1, got 1.5";
        target => target.planner.spread = f64::NAN,
            "target: planner.spread: must lie between 0 and 1, got NaN";
    );
    let withdrawn = wire::TargetConfiguration {
        withdrawn: true,
        spots: Vec::new(),
        edges: Vec::new(),
        ..target()
    };
    let announcement = withdrawn.into_core(ModuleSize::METRE).unwrap();
    assert_eq!(announcement.target, None);
    assert_eq!(announcement.expected_modules, None);
}

/// A box of one unit.
fn area(x: f64, y: f64) -> wire::Area {
    let (width, height) = (1.0, 1.0);
    wire::Area {
        x,
        y,
        width,
        height,
    }
}

fn member(module_id: u32) -> wire::RosterMember {
    wire::RosterMember {
        module_id,
        incarnation: 1,
        knows: true,
        is_idle: true,
        service: wire::ModuleState::SERVICE_ACTIVE,
        x_micro: 1_000_000,
        y_micro: 0,
        theta_micro: 0,
        links: vec![9],
        configuration_id: NONE,
        leader_id: NONE,
        pinned_spot_id: NONE,
    }
}

/// Shows C6.
#[test]
fn rosters() {
    let span = wire::Duration { sec: 1, nanosec: 5 };
    let plan = wire::Roster {
        protocol_version: PROTOCOL_VERSION,
        session: 8,
        target_digest: 0,
        heartbeat: span,
        suspicion: span,
        lease: span,
        epoch: EPOCH,
        stage: wire::Roster::STAGE_PLAN,
        target_revision: 5,
        target: target(),
        members: vec![member(1), member(4)],
        voters: vec![1, 4, 5],
        removed_voters: vec![5],
        listed_voters: Vec::new(),
        bodies: vec![body(7), body(9)],
    };
    refusals!(plan, model::RosterMessage:
        roster => roster.protocol_version = 1,
            "roster: protocol_version: is 1, but this program speaks version 9; run the same build everywhere";
        roster => roster.lease.sec = -1, "roster: lease: needs sec >= 0 and nanosec < 10^9";
        roster => roster.epoch = NO_EPOCH, "roster: epoch: number 0 stands for no epoch, but one is needed here";
        roster => roster.stage = 0, "roster: stage: 0 is unknown; known are GATHER 1, PLAN 2";
        roster => roster.stage = wire::Roster::STAGE_GATHER,
            "roster: target.spots: must be empty while the epoch gathers";
        roster => roster.target_revision = 4, "roster: target.revision: differs from target_revision";
        roster => roster.target.planner.d_max = -9,
            "roster: target.planner.d_max: -9 is unknown; known are 0 and above, and UNBOUNDED -1";
        roster => { roster.target.spots.clear(); roster.target.edges.clear(); }, "roster: target: spots: the target needs at least one spot";
        roster => roster.members.clear(), "roster: members: a plan needs at least one member";
        roster => roster.members.reverse(),
            "roster: members[1]: module 4 must stand after module 1, the list ascends";
        roster => roster.members[1].module_id = 1, "roster: members[1]: module 1 is listed twice";
        roster => roster.members[1].service = 4,
            "roster: members[1].service: 4 is unknown; known are ACTIVE 1, RETIRED 2, MOTION_FAILED 3";
        roster => roster.members[1].x_micro = 1_000_000_000_001,
            "roster: members[1].x_micro: must lie within +-1000000000000, 1000000 to the unit or radian, got \
             1000000000001";
        roster => roster.members[1].y_micro = i64::MIN,
            "roster: members[1].y_micro: must lie within +-1000000000000, 1000000 to the unit or radian, got \
             -9223372036854775808";
        roster => roster.members[1].links = vec![4], "roster: members[1].links[0]: names module 4 itself";
        roster => roster.members[1].pinned_spot_id = 7,
            "roster: members: module 4 is pinned to spot 7, which the target does not have";
        roster => for member in &mut roster.members { member.pinned_spot_id = 2 },
            "roster: members: module 1 and module 4 are both pinned to spot 2";
        roster => roster.members = vec![member(1); bounds::MODULES_MAX + 1],
            "roster: members: 10001 entries, at most 10000 are allowed";
        roster => roster.voters = vec![4, 1, 5],
            "roster: voters[1]: module 4 must stand after module 1, the list ascends";
        roster => roster.voters = (0..=10_000).collect(), "roster: voters: 10001 entries, at most 10000 are allowed";
        roster => roster.removed_voters[0] = NONE,
            "roster: removed_voters[0]: 4294967295 stands for none and cannot be used here";
        roster => roster.listed_voters = vec![5, 5], "roster: listed_voters[1]: module 5 is listed twice";
        roster => roster.bodies.reverse(), "roster: bodies[1]: module 9 must stand after module 7, the list ascends";
        roster => roster.bodies[1].module_id = 7, "roster: bodies[1]: module 7 is listed twice";
        roster => roster.bodies[1].whereabouts = 0,
            "roster: bodies[1].whereabouts: 0 is unknown; known are SEEN 1, ON_THE_WAY 2, HALTED 3, REMOVED 4, IN_BLOCK 5";
        roster => roster.bodies[1].x_micro = 1_000_000_000_001,
            "roster: bodies[1].x_micro: must lie within +-1000000000000, 1000000 to the unit or radian, got \
             1000000000001";
        roster => roster.bodies[1] = on_the_way(9, &[1, 2, 3, 4, i64::MAX, 6]),
            "roster: bodies[1].path_micro: must lie within +-1000000000000, 1000000 to the unit or radian, got \
             9223372036854775807";
        roster => roster.bodies[1] = on_the_way(9, &[1, 2, 3, 4]),
            "roster: bodies[1].path_micro: the number of entries is not a multiple of three";
        roster => roster.bodies[1] = on_the_way(9, &[0; 768]),
            "roster: bodies[1].path_micro: 768 entries, at most 765 are allowed";
        roster => roster.bodies[1].path_micro = vec![1, 2, 3],
            "roster: bodies[1].path_micro: only a body on the way has a path";
        roster => roster.bodies = (0..=10_000).map(body).collect(),
            "roster: bodies: 10001 entries, at most 10000 are allowed";
    );
    let gather = wire::Roster {
        protocol_version: PROTOCOL_VERSION,
        epoch: EPOCH,
        stage: wire::Roster::STAGE_GATHER,
        target_revision: 5,
        ..wire::Roster::default()
    };
    refusals!(gather, model::RosterMessage:
        roster => roster.epoch = NO_EPOCH, "roster: epoch: number 0 stands for no epoch, but one is needed here";
        roster => roster.members = vec![member(1)], "roster: members: must be empty while the epoch gathers";
        roster => roster.voters = vec![1], "roster: voters: must be empty while the epoch gathers";
        roster => roster.bodies = vec![body(1)], "roster: bodies: must be empty while the epoch gathers";
        roster => roster.target.edges = target().edges,
            "roster: target.edges: must be empty while the epoch gathers";
    );
}

fn eviction() -> wire::EvictionRecord {
    wire::EvictionRecord {
        evicted_module_id: 4,
        by_module_id: 5,
        from_spot_id: 1,
        to_spot_id: 2,
    }
}

#[test]
fn claims() {
    let selection = |spot_id, module_id| wire::SpotSelection { spot_id, module_id };
    let claim = wire::SpotClaim {
        protocol_version: PROTOCOL_VERSION,
        session: 8,
        epoch: EPOCH,
        turn: 0,
        claimant_id: 5,
        incarnation: 1,
        selections: vec![selection(1, 5), selection(2, 4)],
        evictions: vec![eviction()],
        detached: vec![6, 7],
        swaps: vec![selection(1, 4), selection(2, 5)],
    };
    refusals!(claim, model::SpotClaim:
        claim => claim.epoch = NO_EPOCH, "claims: epoch: number 0 stands for no epoch, but one is needed here";
        claim => claim.turn = 20_000, "claims: turn: must be at most 19999, got 20000";
        claim => claim.claimant_id = NONE,
            "claims: claimant_id: 4294967295 stands for none and cannot be used here";
        claim => claim.selections[1].spot_id = 1, "claims: selections[1]: spot 1 is listed twice";
        claim => claim.selections[1].spot_id = 0,
            "claims: selections[1]: spot 1 must stand after spot 0, the list ascends";
        claim => claim.selections[1].module_id = 5, "claims: selections[1]: module 5 is listed twice";
        claim => claim.selections[1].spot_id = NONE,
            "claims: selections[1].spot_id: 4294967295 stands for none and cannot be used here";
        claim => claim.selections[0].module_id = NONE,
            "claims: selections[0].module_id: 4294967295 stands for none and cannot be used here";
        claim => claim.selections = vec![selection(1, 1); bounds::SPOTS_MAX + 1],
            "claims: selections: 10001 entries, at most 10000 are allowed";
        claim => claim.evictions[0].by_module_id = 4, "claims: evictions[0].by_module_id: names module 4 itself";
        claim => claim.evictions[0].to_spot_id = 1,
            "claims: evictions[0].to_spot_id: sends the evicted module back to spot 1, which it loses";
        claim => claim.evictions[0].from_spot_id = NONE,
            "claims: evictions[0].from_spot_id: 4294967295 stands for none and cannot be used here";
        claim => claim.evictions = vec![eviction(); bounds::MODULES_MAX + 1],
            "claims: evictions: 10001 entries, at most 10000 are allowed";
        claim => claim.detached = vec![7, 6],
            "claims: detached[1]: module 7 must stand after module 6, the list ascends";
        claim => claim.detached = (0..=10_000).collect(),
            "claims: detached: 10001 entries, at most 10000 are allowed";
        claim => claim.swaps = vec![selection(1, 1); bounds::SPOTS_MAX + 1],
            "claims: swaps: 10001 entries, at most 10000 are allowed";
    );
}

#[test]
fn evictions() {
    let notice = wire::Eviction {
        protocol_version: PROTOCOL_VERSION,
        session: 8,
        epoch: EPOCH,
        turn: 3,
        eviction: eviction(),
    };
    refusals!(notice, model::EvictionNotice:
        notice => notice.epoch = NO_EPOCH, "evictions: epoch: number 0 stands for no epoch, but one is needed here";
        notice => notice.eviction.evicted_module_id = NONE,
            "evictions: eviction.evicted_module_id: 4294967295 stands for none and cannot be used here";
        notice => notice.eviction.by_module_id = 4, "evictions: eviction.by_module_id: names module 4 itself";
    );
}

#[test]
fn heartbeats() {
    let heartbeat = |module_id| wire::ModuleHeartbeat {
        module_id,
        incarnation: 1,
        knows: true,
        voters_digest: 3,
        sequence: 9,
        uptime: wire::Duration {
            sec: 4,
            nanosec: 500_000_000,
        },
        epoch: EPOCH,
        has_digest: true,
        digest: 0,
        digest_since: 9,
        applied_turns: 4,
        steps_done: 0,
        phase: wire::ModuleState::PHASE_AGREEING,
        stop: wire::Stop::default(),
    };
    let valid = wire::Heartbeat {
        protocol_version: PROTOCOL_VERSION,
        session: 8,
        misses: vec![2, 7],
        modules: vec![heartbeat(4), heartbeat(1)],
        module_size: 1.0,
    };
    refusals!(valid, Vec<model::Heartbeat>:
        sample => sample.modules[1].module_id = 4, "heartbeats: modules[1]: module 4 is listed twice";
        sample => sample.modules[1].module_id = NONE,
            "heartbeats: modules[1].module_id: 4294967295 stands for none and cannot be used here";
        sample => sample.misses[1] = NONE,
            "heartbeats: misses[1]: 4294967295 stands for none and cannot be used here";
        sample => sample.misses[1] = 1, "heartbeats: misses[1]: module 2 must stand after module 1, the list ascends";
        sample => sample.modules[1].uptime.sec = -1,
            "heartbeats: modules[1].uptime: needs sec >= 0 and nanosec < 10^9";
        sample => sample.modules[1].uptime.nanosec = 1_000_000_000,
            "heartbeats: modules[1].uptime: needs sec >= 0 and nanosec < 10^9";
        sample => sample.modules[1].epoch = NO_EPOCH,
            "heartbeats: modules[1].digest: there cannot be one without an epoch";
        sample => { sample.modules[1].has_digest = false; sample.modules[1].digest = 1; },
            "heartbeats: modules[1].digest: must be 0 while has_digest is false";
        sample => sample.modules[1].has_digest = false,
            "heartbeats: modules[1].digest_since: must be 0 without a digest, and only then";
        sample => sample.modules[1].digest_since = 0,
            "heartbeats: modules[1].digest_since: must be 0 without a digest, and only then";
        sample => sample.modules[1].digest_since = 10,
            "heartbeats: modules[1].digest_since: lies after this heartbeat's sequence";
        sample => {
            let module = &mut sample.modules[1];
            (module.epoch, module.has_digest, module.digest_since) = (NO_EPOCH, false, 0);
        }, "heartbeats: modules[1].applied_turns: must be 0 without an epoch";
        sample => {
            let module = &mut sample.modules[1];
            (module.has_digest, module.digest_since, module.steps_done) = (false, 0, 1);
        }, "heartbeats: modules[1].steps_done: must be 0 without a plan";
        sample => sample.modules[1].phase = 11,
            "heartbeats: modules[1].phase: 11 is unknown; known are LISTENING 1, GATHERED 2, PLANNING 3, AGREEING 4, \
             WAITING 5, MOVING 6, SETTLED 7, SPARE 8, WAITING_FOR_QUORUM 9, COMPUTING 10";
        sample => sample.modules = vec![heartbeat(1); bounds::MODULES_MAX + 1],
            "heartbeats: modules: 10001 entries, at most 10000 are allowed";
    );
}

#[test]
fn commands() {
    let valid = wire::OperatorCommand {
        protocol_version: PROTOCOL_VERSION,
        session: 0,
        stop: wire::Stop {
            revision: 1,
            stopped: true,
        },
        removals: vec![removal(4), removal(1)],
    };
    refusals!(valid, Vec<model::Message>:
        sample => sample.protocol_version = 1,
            "commands: protocol_version: is 1, but this program speaks version 9; run the same build everywhere";
        sample => sample.removals[1].incarnation = 0,
            "commands: removals[1].incarnation: 0 names no run; give the incarnation that heartbeats or a roster showed";
        sample => sample.removals[1].module_id = 4, "commands: removals[1]: module 4 is listed twice";
        sample => sample.removals[1].module_id = NONE,
            "commands: removals[1].module_id: 4294967295 stands for none and cannot be used here";
        sample => sample.removals = vec![removal(1); bounds::MODULES_MAX + 1],
            "commands: removals: 10001 entries, at most 10000 are allowed";
    );
}
