//! Processes that host several modules, without DDS between them.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::path::Path;
use std::rc::Rc;

use formation_model::{Epoch, Incarnation, Scenario, TargetAnnouncement, Whereabouts};
use formation_protocol::DurableState;

use super::*;

mod pushed;
mod rejoining;

const SCENARIO: &str = "
target: {spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}, {id: 3, x: 7.0, y: 5.0}], edges: [[1, 2], [2, 3]]}
configurations:
  - {id: 7, leader: 5, modules: [{id: 4, x: 1.0, y: 2.0}, {id: 5, x: 2.0, y: 2.0}], edges: [[4, 5]]}
singletons: [{id: 17, x: 3.0, y: 9.5, theta: 1.2}]
";
const TARGET_PUBLISHER: SourceId = SourceId(1);
const OTHER_PROCESS: SourceId = SourceId(2);

fn host(modules: &[u32]) -> (Host, Message) {
    host_with(SCENARIO, modules, None)
}

/// A process of another scenario, with a store in a directory, if one is given.
fn host_with(scenario: &str, modules: &[u32], stores: Option<&Path>) -> (Host, Message) {
    let scenario = Scenario::from_yaml(scenario).unwrap();
    let problem = scenario.problem();
    let identities = problem
        .modules()
        .iter()
        .filter(|module| modules.contains(&module.id.0))
        .map(|module| Identity::of(module, Incarnation(1)))
        .map(|identity| (identity, Service::Active));
    let mut identities = identities.collect();
    let journal = stores.map(|directory| {
        let name = format!("module_{}", modules[0]);
        let mut journal = Journal::open(directory, &name, (7, false), &mut identities).unwrap();
        journal.begin(&identities).unwrap();
        journal
    });
    let source = SourceId(u128::from(modules[0]) + 100);
    let motion = Motion {
        speed: 5.0,
        pushable: true,
        ..Motion::default()
    };
    let host = Host::new(
        source,
        identities,
        AgentParameters::default(),
        &motion,
        &[],
        journal.map_or_else(KeptMemory::default, KeptMemory::File),
    );
    let target = Message::Target(Arc::new(TargetAnnouncement {
        expected_modules: Some(3),
        ..TargetAnnouncement::new(problem, 1)
    }));
    (host, target)
}

/// The samples that the processes publish until `limit`; each process receives those of the others.
fn run(hosts: &mut [Host], limit: Duration) -> Vec<Outgoing> {
    run_between(hosts, Duration::ZERO, limit)
}

/// The same from a later moment on.
fn run_between(hosts: &mut [Host], begin: Duration, limit: Duration) -> Vec<Outgoing> {
    run_with_clocks(hosts, begin, limit, &[])
}

/// The same, with clocks that are late by as much as is given.
fn run_with_clocks(
    hosts: &mut [Host],
    begin: Duration,
    limit: Duration,
    late: &[Duration],
) -> Vec<Outgoing> {
    let mut said = Vec::new();
    let mut now = begin;
    let late = |host: usize| late.get(host).copied().unwrap_or_default();
    while now < limit {
        for speaker in 0..hosts.len() {
            let now = now - late(speaker);
            hosts[speaker].advance(now);
            compute(&mut hosts[speaker], now);
            write(&mut hosts[speaker], now);
            let outgoing = hosts[speaker].take_outgoing();
            let source = hosts[speaker].source;
            for listener in (0..hosts.len()).filter(|&listener| listener != speaker) {
                for message in outgoing.iter().flat_map(messages_of) {
                    hosts[listener].take_message(source, message);
                }
            }
            said.extend(outgoing);
        }
        now = hosts
            .iter()
            .enumerate()
            .filter_map(|(index, host)| Some(host.due()? + late(index)))
            .min()
            .map_or(limit, |due| due.max(now + Duration::from_millis(1)));
    }
    said
}

/// Computes all plans that a host asks for.
fn compute(host: &mut Host, now: Duration) {
    while let Some(job) = host.next_job() {
        host.handle_computed(now, &Arc::new(job.run()));
    }
}

/// Writes all that a host gives to its store, if it has one.
fn write(host: &mut Host, now: Duration) {
    while let Some(job) = host.next_write() {
        let store = host.journal.as_ref().unwrap().store();
        host.handle_written(now, job.run(&store).unwrap());
    }
}

fn phase_of(host: &Host, module: u32) -> Option<ModulePhase> {
    host.status_of(ModuleId(module)).map(|(_, phase)| phase)
}

fn messages_of(outgoing: &Outgoing) -> Vec<Message> {
    match outgoing.clone() {
        Outgoing::ModuleStates(states) => states.into_iter().map(Message::ModuleState).collect(),
        Outgoing::Heartbeats(heartbeats) => {
            heartbeats.into_iter().map(Message::Heartbeat).collect()
        }
        Outgoing::Roster(roster) => vec![Message::Roster(roster)],
        Outgoing::Claim(claim) => vec![Message::Claim(claim)],
        Outgoing::Eviction(notice) => vec![Message::Eviction(notice)],
        Outgoing::Drive(..) | Outgoing::Path(..) => Vec::new(),
    }
}

fn states_of(said: &[Outgoing]) -> Vec<&Vec<Arc<ModuleState>>> {
    said.iter()
        .filter_map(|outgoing| match outgoing {
            Outgoing::ModuleStates(states) => Some(states),
            _ => None,
        })
        .collect()
}

fn assert_all_settle(groups: &[&[u32]]) {
    let mut hosts: Vec<Host> = Vec::new();
    for group in groups {
        let (mut host, target) = host(group);
        host.take_message(TARGET_PUBLISHER, target);
        hosts.push(host);
    }
    let said = run(&mut hosts, Duration::from_secs(30));
    let mut settled = BTreeMap::new();
    for state in states_of(&said).into_iter().flatten() {
        if state.phase == ModulePhase::Settled {
            settled.insert(state.module.0, state.spot.map(|spot| spot.0));
        }
    }
    let spots: BTreeSet<_> = settled.values().copied().collect();
    assert_eq!(settled.len(), 3, "{groups:?}: {settled:?}");
    assert_eq!(spots, [Some(1), Some(2), Some(3)].into(), "{groups:?}");
}

#[test]
fn modules_form_the_target_however_they_are_spread_over_processes() {
    assert_all_settle(&[&[4, 5, 17]]);
    assert_all_settle(&[&[4, 17], &[5]]);
    assert_all_settle(&[&[4], &[5], &[17]]);
}

#[test]
fn evictions_which_only_observers_need_follow_the_claims() {
    let scenario = "
target: {spots: [{id: 1, x: 10.0, y: 10.0}, {id: 2, x: 11.0, y: 10.0}, {id: 3, x: 12.0, y: 10.0}], edges: [[1, 2], [2, 3]]}
singletons: [{id: 1, x: 10.0, y: 8.0}, {id: 2, x: 10.0, y: 6.0}, {id: 3, x: 4.0, y: 10.0}]
";
    let (mut host, target) = host_with(scenario, &[1, 2, 3], None);
    host.take_message(TARGET_PUBLISHER, target);
    let said = run(&mut [host], Duration::from_secs(5));
    let (mut claims, mut evictions) = (0, 0);
    for outgoing in said {
        match outgoing {
            Outgoing::Claim(_) => {
                assert_eq!(evictions, 0);
                claims += 1;
            }
            Outgoing::Eviction(_) => evictions += 1,
            _ => {}
        }
    }
    assert!(claims == 3 && evictions >= 1, "{claims} {evictions}");
}

/// Shows C4.
#[test]
fn a_sample_lists_the_states_that_are_new_and_the_last_one_lists_all() {
    let (mut host, target) = host(&[4, 5, 17]);
    host.take_message(TARGET_PUBLISHER, target);
    let said = run(&mut [host], Duration::from_secs(30));
    let mut latest: BTreeMap<u32, u64> = BTreeMap::new();
    let samples: Vec<Vec<(u32, u64)>> = states_of(&said)
        .into_iter()
        .map(|states| {
            states
                .iter()
                .map(|one| (one.module.0, one.sequence))
                .collect()
        })
        .collect();
    for sample in &samples {
        for &(module, sequence) in sample {
            let last = latest.entry(module).or_insert(sequence);
            assert!(sequence - *last <= 1, "{module}: {sequence} follows {last}");
            *last = sequence;
        }
    }
    assert!(latest.values().all(|&sequence| sequence > 5), "{latest:?}");
    assert!(
        samples.iter().any(|sample| sample.len() == 1),
        "{samples:?}"
    );
    let last: BTreeMap<u32, u64> = samples.last().unwrap().iter().copied().collect();
    assert_eq!(last, latest, "what a late subscriber gets");
}

#[test]
fn heartbeats_that_fall_due_together_share_a_sample() {
    let (host, _) = host(&[4, 5, 17]);
    let said = run(&mut [host], Duration::from_secs(5));
    let beats: Vec<usize> = said
        .iter()
        .filter_map(|outgoing| match outgoing {
            Outgoing::Heartbeats(heartbeats) => Some(heartbeats.len()),
            _ => None,
        })
        .collect();
    assert_eq!(beats, [3; 10], "two a second, each for all three");
}

/// Shows C4.
#[test]
fn heartbeats_share_a_sample_after_modules_have_shown_something_at_different_times() {
    let (host, target) = host(&[4, 5, 17]);
    let mut hosts = [host];
    hosts[0].take_message(TARGET_PUBLISHER, target);
    let said = run(&mut hosts, Duration::from_secs(60));
    let heartbeats = said.iter().filter_map(|outgoing| match outgoing {
        Outgoing::Heartbeats(heartbeats) => Some(heartbeats.len()),
        _ => None,
    });
    let sizes: Vec<usize> = heartbeats.collect();
    assert!(sizes.contains(&1), "no module has shown something alone");
    assert!(sizes.ends_with(&[3; 20]), "{sizes:?}");
}

#[test]
fn a_message_that_an_agent_refuses_is_counted_for_it() {
    let (mut host, target) = host(&[4, 5]);
    let now = Duration::from_secs(1);
    host.advance(now);
    let Message::Target(announcement) = &target else {
        unreachable!("it was made as a target");
    };
    let mut other = announcement.as_ref().clone();
    other.expected_modules = Some(9);
    host.take_message(TARGET_PUBLISHER, target);
    host.take_message(OTHER_PROCESS, Message::Target(Arc::new(other)));
    host.advance(now);
    for (module, refusals) in host.refusals() {
        assert_eq!(refusals.to_string(), "contradicting_target 1", "{module}");
    }
}

#[test]
fn a_module_that_is_added_receives_what_it_missed_and_takes_an_open_spot() {
    let (mut host, target) = host(&[4, 5, 17]);
    let mut now = Duration::ZERO;
    let mut pass = |host: &mut Host, seconds| {
        let end = now + Duration::from_secs(seconds);
        while now < end {
            host.advance(now);
            compute(host, now);
            host.take_outgoing();
            let due = host.due().unwrap_or(end);
            now = due.max(now + Duration::from_millis(1)).min(end);
        }
        now
    };
    host.take_message(TARGET_PUBLISHER, target);
    let formed = pass(&mut host, 40);
    for module in [4, 5, 17] {
        let phase = phase_of(&host, module);
        assert_eq!(phase, Some(ModulePhase::Settled), "module {module}");
    }
    host.command(formed, ModuleId(17), Command::Retire);
    let left = pass(&mut host, 40);
    assert_eq!(phase_of(&host, 17), Some(ModulePhase::Spare));
    // The target is not announced again.
    let newcomer = Identity::single(ModuleId(18).run(Incarnation(2)), Pose::default());
    host.add(left, newcomer).unwrap();
    pass(&mut host, 40);
    let phase = phase_of(&host, 18);
    assert_eq!(phase, Some(ModulePhase::Settled));
}

/// Shows T5.
#[test]
fn one_plan_serves_all_modules_and_heartbeats_continue_until_it_is_computed() {
    let (mut host, target) = host(&[4, 5, 17]);
    host.take_message(TARGET_PUBLISHER, target);
    let mut now = Duration::ZERO;
    let mut job = None;
    let mut heartbeats = Vec::new();
    while now < Duration::from_secs(40) {
        host.advance(now);
        if let Some(next) = host.next_job() {
            assert_eq!(job.replace((now, next)), None, "a second job");
        }
        for outgoing in host.take_outgoing() {
            if let Outgoing::Heartbeats(beats) = outgoing {
                heartbeats.extend(beats.into_iter().map(|heartbeat| (now, heartbeat)));
            }
        }
        let due = host.due().unwrap();
        now = due.max(now + Duration::from_millis(1));
    }
    let (asked_at, job) = job.expect("all modules are there");
    for module in [4, 5, 17] {
        assert_eq!(phase_of(&host, module), Some(ModulePhase::Computing));
        let sent = heartbeats.iter().filter(|(at, heartbeat)| {
            let is_later = *at > asked_at + Duration::from_secs(1);
            is_later && heartbeat.module.0 == module
        });
        let sent = sent.count();
        let seconds = (now - asked_at).as_secs();
        assert!(
            u64::try_from(sent).unwrap() >= 2 * (seconds - 3),
            "{sent} in {seconds} s"
        );
    }
    host.handle_computed(now, &Arc::new(job.run()));
    for module in [4, 5, 17] {
        assert_ne!(phase_of(&host, module), Some(ModulePhase::Computing));
    }
    assert_eq!(host.next_job(), None);
}

/// Where modules settled, and to which others they are docked there.
type Places = BTreeMap<ModuleId, (Pose, BTreeSet<ModuleId>)>;

/// Lets three processes with stores form the target; returns where their modules settled, the last epoch, and whether any
/// module moved.
fn form_with_stores(directory: &Path) -> (Places, Option<Epoch>, bool) {
    let mut hosts = Vec::new();
    for module in [4, 5, 17] {
        let (mut host, target) = host_with(SCENARIO, &[module], Some(directory));
        host.take_message(TARGET_PUBLISHER, target);
        hosts.push(host);
    }
    let said = run(&mut hosts, Duration::from_secs(40));
    let states = || states_of(&said).into_iter().flatten();
    let settled = states().filter(|state| state.phase == ModulePhase::Settled);
    let epoch = settled.clone().filter_map(|state| state.epoch).max();
    let places = settled
        .map(|state| (state.module, (state.pose, state.links.clone())))
        .collect();
    let moved = states().any(|state| state.phase == ModulePhase::Moving);
    (places, epoch, moved)
}

/// Shows Q9.
#[test]
fn processes_that_all_restart_continue_from_their_stores() {
    let directory = tempfile::tempdir().unwrap();
    let (before, first, moved) = form_with_stores(directory.path());
    assert_eq!((before.len(), moved), (3, true));
    let (after, second, moved) = form_with_stores(directory.path());
    assert_eq!(
        (&after, moved),
        (&before, false),
        "each module stays on its spot"
    );
    assert!(second > first, "{second:?} follows {first:?}");
}

#[test]
fn a_link_that_one_of_two_stores_lacks_is_there_again() {
    let directory = tempfile::tempdir().unwrap();
    let (before, ..) = form_with_stores(directory.path());
    for module in [4, 5, 17] {
        let (host, _) = host_with(SCENARIO, &[module], Some(directory.path()));
        let run = host.replica.agents()[0].run();
        let mut journal = host.journal.unwrap();
        let mut state = journal.state_of(ModuleId(module)).unwrap();
        assert!(!state.links.is_empty(), "module {module}");
        state.links.clear();
        journal.persist(run, 1, state);
        let store = journal.store();
        journal.next_job().unwrap().run(&store).unwrap();
        drop((journal, store));
        let (after, ..) = form_with_stores(directory.path());
        assert_eq!(after, before, "without the links of module {module}");
    }
}

#[test]
fn modules_of_a_process_share_a_write_and_publish_nothing_before_it() {
    let directory = tempfile::tempdir().unwrap();
    let (mut host, _) = host_with(SCENARIO, &[4, 5, 17], Some(directory.path()));
    host.advance(Duration::ZERO);
    let job = host.next_write().unwrap();
    assert!(host.next_write().is_none(), "one write for all three");
    assert_eq!(host.take_outgoing(), []);
    let store = host.journal.as_ref().unwrap().store();
    host.handle_written(Duration::ZERO, job.run(&store).unwrap());
    let Some(Outgoing::Heartbeats(heartbeats)) = host.take_outgoing().pop() else {
        panic!("no heartbeats");
    };
    assert_eq!(heartbeats.len(), 3);
}

#[test]
fn bodies_are_found_again_for_a_new_plan_and_a_new_spot_and_not_for_each_stop() {
    let directory = tempfile::tempdir().unwrap();
    let (mut host, target) = host_with(SCENARIO, &[4, 5, 17], Some(directory.path()));
    host.take_message(TARGET_PUBLISHER, target);
    let mut states: Vec<DurableState> = Vec::new();
    let (mut now, limit) = (Duration::ZERO, Duration::from_secs(60));
    while now < limit {
        host.advance(now);
        compute(&mut host, now);
        write(&mut host, now);
        host.take_outgoing();
        let journal = host.journal.as_ref().unwrap();
        let state = journal.state_of(ModuleId(17));
        states.extend(state.filter(|state| states.last() != Some(state)));
        now = host.due().unwrap().max(now + Duration::from_millis(1));
    }
    let is_same = |pair: &[DurableState]| Arc::ptr_eq(&pair[0].bodies, &pair[1].bodies);
    // With a plan and the same spot, what differs is that it has set off or stopped.
    let moves = |pair: &&[DurableState]| {
        let mut bodies = pair[0].bodies.iter();
        let has_plan = bodies.any(|body| matches!(body.whereabouts, Whereabouts::InBlock(_)));
        has_plan && pair[0].settled_on == pair[1].settled_on
    };
    assert!(states.windows(2).any(|pair| moves(&pair)), "{states:?}");
    assert!(states.windows(2).filter(moves).all(is_same), "{states:?}");
    let settled = states.windows(2).find(|pair| pair[1].settled_on.is_some());
    assert!(!is_same(settled.unwrap()), "{states:?}");
    let last = states.last().unwrap();
    assert_eq!(last.bodies.len(), 2, "{last:?}");
}

#[test]
fn a_retirement_is_confirmed_once_the_store_holds_it_and_outlives_the_process() {
    let directory = tempfile::tempdir().unwrap();
    let (mut host, _) = host_with(SCENARIO, &[17], Some(directory.path()));
    host.advance(Duration::ZERO);
    write(&mut host, Duration::ZERO);
    host.command(Duration::ZERO, ModuleId(17), Command::Retire);
    let is_confirmed = Rc::new(Cell::new(false));
    let confirm = Rc::clone(&is_confirmed);
    host.answer(move || confirm.set(true));
    assert!(!is_confirmed.get());
    write(&mut host, Duration::ZERO);
    assert!(is_confirmed.get());
    drop(host);
    let (host, _) = host_with(SCENARIO, &[17], Some(directory.path()));
    let service = host.status_of(ModuleId(17)).map(|(service, _)| service);
    assert_eq!(service, Some(Service::Retired));
}

#[test]
fn a_host_that_takes_over_in_the_same_process_continues_from_the_store() {
    let directory = tempfile::tempdir().unwrap();
    let (mut host, _) = host_with(SCENARIO, &[17], Some(directory.path()));
    host.advance(Duration::ZERO);
    write(&mut host, Duration::ZERO);
    host.command(Duration::ZERO, ModuleId(17), Command::Retire);
    // The thread that wrote for the first host has not finished, and must not undo what the second one writes.
    let late = host.next_write().unwrap();
    let mut modules = host.modules();
    let KeptMemory::File(mut journal) = host.into_memory() else {
        panic!("it has a store");
    };
    modules[0].0.incarnation.0 += 5;
    journal.begin(&modules).unwrap();
    late.run(&journal.store()).unwrap();
    let (parameters, motion) = (AgentParameters::default(), Motion::default());
    let next = Host::new(
        SourceId(9),
        modules.clone(),
        parameters,
        &motion,
        &[],
        KeptMemory::File(journal),
    );
    assert_eq!(next.modules(), modules);
    assert_eq!(modules[0].1, Service::Retired);
    drop(next);
    let (again, _) = host_with(SCENARIO, &[17], Some(directory.path()));
    let (identity, service) = again.modules().pop().unwrap();
    assert_eq!(service, Service::Retired);
    assert!(identity.incarnation > modules[0].0.incarnation);
}

#[test]
fn a_module_that_was_added_is_hosted_again_where_it_stood() {
    let directory = tempfile::tempdir().unwrap();
    let (mut host, _) = host_with(SCENARIO, &[17], Some(directory.path()));
    let pose = Pose::from_units(2.0, 3.0, 0.0).unwrap();
    let newcomer = Identity::single(ModuleId(18).run(Incarnation(u64::MAX - 9)), pose);
    host.add(Duration::ZERO, newcomer.clone()).unwrap();
    host.advance(Duration::ZERO);
    write(&mut host, Duration::ZERO);
    drop(host);
    let (host, _) = host_with(SCENARIO, &[17], Some(directory.path()));
    let (again, _) = host.modules().pop().unwrap();
    assert_eq!((again.module, again.pose), (ModuleId(18), pose));
    assert_eq!(
        again.incarnation,
        Incarnation(u64::MAX - 8),
        "after the last"
    );
    drop(host);
    // In another process, a module whose memory is here would begin without it.
    let (mut other, _) = host_with(SCENARIO, &[5], Some(directory.path()));
    let reason = other.add(Duration::ZERO, newcomer).unwrap_err();
    assert!(reason.contains("module_17.session_7.json"), "{reason}");
}
