//! Strategies for everything that agents may send to each other.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroU64;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    BodyReport, CausalMark, ConfigurationId, CutPrice, Decision, Digest, DriveState, Epoch,
    EvictionNotice, EvictionRecord, Heartbeat, Incarnation, MicroUnits, ModuleId, ModulePhase,
    ModuleRun, ModuleState, PaperBundle, PaperOptions, PlannerParameters, PlanningModule, Policy,
    Polyline, Pose, RawSpot, RawTarget, Removal, Roster, RosterMember, RosterMessage, SenderTime,
    Service, SpotClaim, SpotId, SpotSelection, Spread, Stop, TURNS_MAX, Target, TargetAnnouncement,
    Timing, TurnOrder, Voters, Weights, Whereabouts,
};
use proptest::collection::{btree_set, vec};
use proptest::option;
use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::surroundings::{for_any_members, placed_within, surroundings};

const LIMIT: i64 = 1_000_000_000_000;

/// Small identifiers often, so that collisions between lists happen; any other now and then.
fn raw_id() -> impl Strategy<Value = u32> {
    prop_oneof![4 => 0..40_u32, 1 => 0..u32::MAX]
}

fn module_id() -> impl Strategy<Value = ModuleId> {
    raw_id().prop_map(ModuleId)
}

fn spot_id() -> impl Strategy<Value = SpotId> {
    raw_id().prop_map(SpotId)
}

fn module_ids() -> impl Strategy<Value = Vec<ModuleId>> {
    btree_set(module_id(), 0..5).prop_map(|modules| modules.into_iter().collect())
}

pub fn micro() -> impl Strategy<Value = MicroUnits> {
    prop_oneof![
        Just(-LIMIT),
        Just(LIMIT),
        -LIMIT..=LIMIT,
        -20_000_000..=20_000_000_i64
    ]
    .prop_map(MicroUnits)
}

fn pose() -> impl Strategy<Value = Pose> {
    (micro(), micro(), micro()).prop_map(|(x, y, theta)| Pose { x, y, theta })
}

fn epoch() -> impl Strategy<Value = Epoch> {
    (1..=u64::MAX, module_id()).prop_map(|(number, convener)| Epoch { number, convener })
}

fn incarnation() -> impl Strategy<Value = Incarnation> {
    any::<u64>().prop_map(Incarnation)
}

fn phase() -> impl Strategy<Value = ModulePhase> {
    select(vec![
        ModulePhase::Listening,
        ModulePhase::Gathered,
        ModulePhase::Planning,
        ModulePhase::Agreeing,
        ModulePhase::Waiting,
        ModulePhase::Moving,
        ModulePhase::Settled,
        ModulePhase::Spare,
        ModulePhase::WaitingForQuorum,
    ])
}

fn service() -> impl Strategy<Value = Service> {
    select(vec![
        Service::Active,
        Service::Retired,
        Service::MotionFailed,
    ])
}

/// An epoch, and a digest only within one.
fn epoch_and_digest() -> impl Strategy<Value = (Option<Epoch>, Option<Digest>)> {
    option::of((epoch(), option::of(any::<u64>().prop_map(Digest))))
        .prop_map(|both| both.map_or((None, None), |(epoch, digest)| (Some(epoch), digest)))
}

fn weights() -> impl Strategy<Value = Weights> {
    (
        0..33_000_000_i64,
        1..33_000_000_i64,
        1..33_000_000_i64,
        any::<bool>(),
    )
        .prop_map(|(undock, more, most, plain)| {
            if plain {
                return Weights::default();
            }
            let units = |micro| MicroUnits(micro).to_units();
            Weights::from_units(
                units(undock + more + most),
                units(undock + more),
                units(undock),
            )
            .unwrap()
        })
}

fn readings() -> impl Strategy<Value = PaperOptions> {
    let bundles = vec![PaperBundle::Literal, PaperBundle::Charitable];
    (select(bundles), 0..6_usize, 1..=10_000_u64).prop_map(|(bundle, own, max)| {
        let mut options = bundle.options().with_max(max).unwrap();
        let (key, value) = &PaperBundle::Charitable.options().named()[own];
        options.set(key, value).unwrap();
        options
    })
}

fn parameters() -> impl Strategy<Value = PlannerParameters> {
    (
        select(Policy::all().map(|(policy, _)| policy).collect::<Vec<_>>()),
        select(vec![TurnOrder::Rank, TurnOrder::SizeFirst]),
        option::of(0..=i32::MAX.unsigned_abs()),
        any::<bool>(),
        weights(),
        (0..=100_000_000_i64, 0..=1_000_000_i64),
        (any::<bool>(), readings()),
    )
        .prop_map(
            |(
                policy,
                order,
                d_max,
                exact_finish,
                weights,
                (cut_price, spread),
                (keep_all_spots, paper),
            )| {
                PlannerParameters {
                    policy,
                    paper: if policy == Policy::Paper {
                        paper
                    } else {
                        PaperOptions::default()
                    },
                    order,
                    d_max,
                    exact_finish,
                    weights,
                    cut_price: CutPrice::from_units(MicroUnits(cut_price).to_units()).unwrap(),
                    spread: Spread::from_units(MicroUnits(spread).to_units()).unwrap(),
                    keep_all_spots,
                }
            },
        )
}

/// A tree on up to ten spots, with a few edges more.
fn target() -> impl Strategy<Value = Target> {
    (
        btree_set(raw_id(), 1..10),
        vec((pose(), any::<Index>()), 10),
        vec((any::<Index>(), any::<Index>()), 0..4),
        "[a-z_/]{0,12}",
    )
        .prop_map(|(ids, placed, chords, frame_id)| {
            let ids: Vec<u32> = ids.into_iter().collect();
            let mut edges = BTreeSet::new();
            for (node, (_, parent)) in placed.iter().enumerate().take(ids.len()).skip(1) {
                edges.insert((parent.index(node), node));
            }
            for (one, other) in chords {
                let (one, other) = (one.index(ids.len()), other.index(ids.len()));
                if one != other {
                    edges.insert((one.min(other), one.max(other)));
                }
            }
            Target::try_from(RawTarget {
                frame_id,
                spots: ids
                    .iter()
                    .zip(&placed)
                    .map(|(&id, (pose, _))| RawSpot {
                        id,
                        x: pose.x.to_units(),
                        y: pose.y.to_units(),
                        theta: pose.theta.to_units(),
                    })
                    .collect(),
                edges: edges
                    .into_iter()
                    .map(|(one, other)| [ids[one], ids[other]])
                    .collect(),
            })
            .unwrap()
        })
}

pub fn announcement() -> impl Strategy<Value = TargetAnnouncement> {
    (
        any::<u64>(),
        "\\PC{0,20}",
        option::weighted(0.8, (target(), surroundings())),
        parameters(),
        option::of(1..=10_000_u32),
        module_ids(),
    )
        .prop_map(
            |(revision, name, target, parameters, expected_modules, voters)| TargetAnnouncement {
                revision,
                name,
                target: target.map(|(target, surroundings)| {
                    Arc::new(placed_within(target, surroundings, &parameters))
                }),
                parameters,
                expected_modules,
                voters: voters.into_iter().collect(),
            },
        )
}

fn marks() -> impl Strategy<Value = Vec<CausalMark>> {
    (module_ids(), any::<u64>()).prop_map(|(modules, sequence)| {
        modules
            .into_iter()
            .rev()
            .map(|module| CausalMark { module, sequence })
            .collect()
    })
}

fn some_modules() -> impl Strategy<Value = BTreeSet<ModuleId>> {
    module_ids().prop_map(|modules| modules.into_iter().collect())
}

fn voters() -> impl Strategy<Value = Voters> {
    (some_modules(), some_modules(), some_modules()).prop_map(|(named, removed, listed)| Voters {
        named: named.into_iter().collect(),
        removed,
        listed,
    })
}

fn bodies() -> impl Strategy<Value = Vec<BodyReport>> {
    let whereabouts = prop_oneof![
        pose().prop_map(Whereabouts::Seen),
        vec(pose(), 1..5)
            .prop_map(|poses| Whereabouts::OnTheWay(Polyline::try_from(poses).unwrap())),
        vec(pose(), 1..5)
            .prop_map(|poses| Whereabouts::InBlock(Polyline::try_from(poses).unwrap())),
        pose().prop_map(Whereabouts::Halted),
        Just(Whereabouts::Removed),
    ];
    let body = (
        module_id(),
        incarnation(),
        option::of(epoch()),
        any::<u64>(),
        whereabouts,
    );
    vec(body, 0..3).prop_map(|mut bodies| {
        bodies.sort_by_key(|body| body.0);
        bodies.dedup_by_key(|body| body.0);
        let reports = bodies.into_iter();
        reports
            .map(
                |(module, incarnation, epoch, sequence, whereabouts)| BodyReport {
                    module,
                    incarnation,
                    epoch,
                    sequence,
                    whereabouts,
                },
            )
            .collect()
    })
}

fn planning_module() -> impl Strategy<Value = PlanningModule> {
    (
        module_id(),
        pose(),
        btree_set(module_id(), 0..5),
        option::of(raw_id().prop_map(ConfigurationId)),
        option::of(module_id()),
        option::of(spot_id()),
    )
        .prop_map(
            |(id, pose, mut links, configuration, leader, pin)| PlanningModule {
                id,
                pose,
                links: {
                    links.remove(&id);
                    links
                },
                configuration,
                leader,
                pin,
            },
        )
}

fn sender_time() -> impl Strategy<Value = SenderTime> {
    let latest = u64::from(i32::MAX.unsigned_abs());
    let times = (0..latest, 0..1_000_000_000_u32);
    times.prop_map(|(seconds, nanos)| SenderTime(Duration::new(seconds, nanos)))
}

fn drive() -> impl Strategy<Value = DriveState> {
    use DriveState::{Displaced, Folding, Lost, Moving, Standing};
    select(vec![Standing, Moving, Folding, Displaced, Lost])
}

pub fn module_state() -> impl Strategy<Value = ModuleState> {
    (
        planning_module(),
        (
            (incarnation(), any::<(bool, bool, Option<NonZeroU64>)>()),
            any::<u64>(),
            epoch_and_digest(),
        ),
        (phase(), service(), sender_time(), drive()),
        (
            option::of(module_id()),
            option::of(any::<u32>()),
            any::<u64>(),
        ),
        (
            marks(),
            marks(),
            (some_modules(), some_modules()),
            bodies(),
            removals(),
            runs(),
        ),
    )
        .prop_map(
            |(
                module,
                ((incarnation, (knows, is_idle, last_plan)), sequence, (epoch, digest)),
                (phase, service, at, drive),
                (unit, steps_done, since),
                (
                    waited_for,
                    agreed_on,
                    (removed_voters, listed_voters),
                    bodies,
                    proposed_removals,
                    refuted_removals,
                ),
            )| ModuleState {
                module: module.id,
                incarnation,
                knows,
                is_idle,
                last_plan: last_plan.map(|digest| Digest(digest.get())),
                sequence,
                epoch,
                digest,
                phase,
                service,
                at,
                drive,
                pose: module.pose,
                links: module.links,
                configuration: module.configuration,
                leader: module.leader,
                spot: module.pin,
                unit,
                steps_done: digest.and(steps_done),
                settled_since: since.min(sequence),
                waited_for,
                agreed_on,
                removed_voters,
                listed_voters,
                bodies,
                proposed_removals,
                refuted_removals,
            },
        )
}

pub fn module_states() -> impl Strategy<Value = Vec<ModuleState>> {
    vec(module_state(), 0..4).prop_map(|mut states| {
        let mut seen = BTreeSet::new();
        states.retain(|state| seen.insert(state.module));
        states
    })
}

fn roster() -> impl Strategy<Value = Roster> {
    (
        epoch(),
        announcement().prop_map(for_any_members),
        vec(
            (
                (incarnation(), any::<(bool, bool)>(), service()),
                planning_module(),
                any::<Index>(),
            ),
            1..6,
        ),
        (voters(), bodies()),
        [0..1_000_000_u64, 0..1_000_000, 0..1_000_000],
    )
        .prop_map(|(epoch, target, mut members, (voters, bodies), times)| {
            let [heartbeat, suspicion, lease] = times.map(Duration::from_millis);
            members.sort_by_key(|(_, module, _)| module.id);
            members.dedup_by_key(|(_, module, _)| module.id);
            // Pins must be spots of the target, each for one member.
            let mut free: Vec<SpotId> = target.target.as_ref().map_or_else(Vec::new, |target| {
                target.spots().iter().map(|spot| spot.id).collect()
            });
            for (_, module, index) in &mut members {
                module.pin = (module.pin.is_some() && !free.is_empty())
                    .then(|| free.remove(index.index(free.len())));
            }
            Roster {
                epoch,
                target,
                members: members
                    .into_iter()
                    .enumerate()
                    .map(
                        |(index, ((incarnation, (knows, is_idle), service), module, _))| {
                            RosterMember {
                                incarnation,
                                knows,
                                is_idle,
                                // One member at least must be active for there to be something to plan.
                                service: if index == 0 { Service::Active } else { service },
                                module,
                            }
                        },
                    )
                    .collect(),
                voters,
                bodies,
                timing: Timing {
                    heartbeat,
                    suspicion,
                    lease,
                },
            }
        })
}

pub fn roster_message() -> impl Strategy<Value = RosterMessage> {
    prop_oneof![
        1 => (epoch(), any::<u64>(), any::<u64>()).prop_map(|(epoch, target_revision, target)| {
            RosterMessage::Gather {
                epoch,
                target_revision,
                target: Digest(target),
            }
        }),
        4 => roster().prop_map(|roster| RosterMessage::Plan(Arc::new(roster.into()))),
    ]
}

fn eviction_record() -> impl Strategy<Value = EvictionRecord> {
    (module_id(), module_id(), spot_id(), option::of(spot_id())).prop_filter_map(
        "an eviction of oneself or back to the lost spot",
        |(evicted, by, from, to)| {
            (evicted != by && to != Some(from)).then_some(EvictionRecord {
                evicted,
                by,
                from,
                to,
            })
        },
    )
}

pub fn claim() -> impl Strategy<Value = SpotClaim> {
    (
        (epoch(), 0..TURNS_MAX, module_id(), incarnation()),
        btree_set(spot_id(), 0..5),
        btree_set(module_id(), 5),
        vec(eviction_record(), 0..4),
        module_ids(),
        btree_set((spot_id(), module_id()), 0..2),
    )
        .prop_map(
            |((epoch, turn, claimant, incarnation), spots, modules, evictions, detached, swaps)| {
                let pair = |(spot, module)| SpotSelection { spot, module };
                SpotClaim {
                    epoch,
                    turn,
                    claimant,
                    incarnation,
                    decision: Decision {
                        selections: spots
                            .into_iter()
                            .zip(modules.into_iter().rev())
                            .map(pair)
                            .collect(),
                        evictions,
                        detached,
                        swaps: swaps.into_iter().map(pair).collect(),
                    },
                }
            },
        )
}

pub fn eviction_notice() -> impl Strategy<Value = EvictionNotice> {
    (epoch(), any::<u32>(), eviction_record()).prop_map(|(epoch, turn, eviction)| EvictionNotice {
        epoch,
        turn,
        eviction,
    })
}

fn heartbeat() -> impl Strategy<Value = Heartbeat> {
    (
        module_id(),
        (incarnation(), any::<(bool, u64)>()),
        1..=u64::MAX,
        (0..=i32::MAX.unsigned_abs(), 0..1_000_000_000_u32),
        epoch_and_digest(),
        any::<Index>(),
        (any::<u32>(), any::<u32>()),
        (phase(), any::<(u64, bool)>()),
    )
        .prop_map(
            |(
                module,
                (incarnation, (knows, voters)),
                sequence,
                (sec, nanosec),
                (epoch, digest),
                since,
                (turns, steps),
                (phase, (revision, stopped)),
            )| {
                let span = usize::try_from(sequence).unwrap_or(usize::MAX);
                Heartbeat {
                    module,
                    incarnation,
                    knows,
                    voters,
                    sequence,
                    uptime: Duration::new(sec.into(), nanosec),
                    epoch,
                    digest,
                    digest_since: digest.map_or(0, |_| since.index(span) as u64 + 1),
                    applied_turns: epoch.map_or(0, |_| turns),
                    steps_done: digest.map_or(0, |_| steps),
                    phase,
                    stop: Stop { revision, stopped },
                    misses: Arc::default(),
                }
            },
        )
}

/// Those of one process, which misses the same modules for all.
pub fn heartbeats() -> impl Strategy<Value = Vec<Heartbeat>> {
    let misses = vec(module_id(), 0..4).prop_map(|misses| {
        let misses: BTreeSet<ModuleId> = misses.into_iter().collect();
        misses.into_iter().collect::<Arc<[ModuleId]>>()
    });
    (vec(heartbeat(), 0..5), misses).prop_map(|(mut heartbeats, misses)| {
        let mut seen = BTreeSet::new();
        heartbeats.retain(|heartbeat| seen.insert(heartbeat.module));
        for heartbeat in &mut heartbeats {
            heartbeat.misses = Arc::clone(&misses);
        }
        heartbeats
    })
}

/// The runs of distinct modules, ascending.
fn runs() -> impl Strategy<Value = Vec<ModuleRun>> {
    let run = (module_id(), (1..=u64::MAX).prop_map(Incarnation));
    vec(run, 0..4).prop_map(|runs| {
        let runs: BTreeMap<ModuleId, Incarnation> = runs.into_iter().collect();
        let runs = runs.into_iter();
        runs.map(|(module, incarnation)| module.run(incarnation))
            .collect()
    })
}

fn removals() -> impl Strategy<Value = Vec<Removal>> {
    (runs(), any::<bool>()).prop_map(|(runs, takes_vote)| {
        let runs = runs.into_iter();
        runs.map(|run| Removal { run, takes_vote }).collect()
    })
}

/// A command to stop or to resume, and bodies that were taken away.
pub fn commands() -> impl Strategy<Value = (Stop, Vec<Removal>)> {
    (any::<(u64, bool)>(), removals())
        .prop_map(|((revision, stopped), removals)| (Stop { revision, stopped }, removals))
}
