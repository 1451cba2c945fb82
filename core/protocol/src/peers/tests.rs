use formation_model::Incarnation;

use super::*;

fn at(seconds: u64) -> Liveness {
    Liveness {
        latest_stamp: 1_000,
        now: Duration::from_secs(seconds),
        period: Duration::from_millis(500),
        suspicion: Duration::from_secs(5),
    }
}

fn heartbeat(incarnation: u64, sequence: u64, uptime_s: u64) -> Heartbeat {
    Heartbeat {
        sequence,
        uptime: Duration::from_secs(uptime_s),
        ..Heartbeat::first(ModuleId(1).run(Incarnation(incarnation)))
    }
}

/// Shows M1.
#[test]
fn a_buffered_heartbeat_is_not_fresh() {
    let mut peers = Peers::of(ModuleId(0));
    peers
        .table_mut()
        .handle_heartbeat(at(10), heartbeat(1, 1, 1), None)
        .unwrap();
    assert!(peers.is_live(at(14), ModuleId(1)));
    // This process slept for 20 s; the heartbeat that was sent one second after the first reaches it only now.
    peers
        .table_mut()
        .handle_heartbeat(at(30), heartbeat(1, 2, 2), None)
        .unwrap();
    assert!(!peers.is_live(at(30), ModuleId(1)));
    peers
        .table_mut()
        .handle_heartbeat(at(30), heartbeat(1, 3, 21), None)
        .unwrap();
    assert!(peers.is_live(at(30), ModuleId(1)));
}

/// Shows C3.
#[test]
fn invented_modules_take_no_more_room_than_there_is() {
    let mut peers = Peers::of(ModuleId(0));
    peers.table_mut().expect(Some(8));
    let mut handle = |now, module| {
        let mut heartbeat = heartbeat(1, now, now);
        heartbeat.module = ModuleId(module);
        peers
            .table_mut()
            .handle_heartbeat(at(now), heartbeat, None)
            .map(|_| ())
    };
    for module in 1..1_025 {
        assert_eq!(handle(1, module), Ok(()));
    }
    assert_eq!(handle(2, 5_000), Err(Refusal::TooManyModules));
    assert_eq!(handle(3, 7), Ok(()), "a known module stays known");
    assert_eq!(handle(7, 5_000), Ok(()), "silent modules make room");
    assert!(peers.get(ModuleId(7)).is_some());
}

/// Shows M2, M3.
#[test]
fn a_second_process_is_refused_until_the_first_is_silent() {
    let mut peers = Peers::of(ModuleId(0));
    let (first, second) = (Some(SourceId(1)), Some(SourceId(2)));
    peers
        .table_mut()
        .handle_heartbeat(at(1), heartbeat(1, 1, 1), first)
        .unwrap();
    assert_eq!(
        peers
            .table_mut()
            .handle_heartbeat(at(2), heartbeat(2, 1, 0), second),
        Err(Refusal::DuplicateModule)
    );
    assert_eq!(
        peers
            .table_mut()
            .handle_heartbeat(at(2), heartbeat(1, 2, 2), second),
        Err(Refusal::WrongSource)
    );
    // What a stranger claims of its uptime is not held against it.
    let _ =
        peers
            .table_mut()
            .handle_heartbeat(at(2), heartbeat(2, 9, 1_000_000), Some(SourceId(3)));
    assert_eq!(
        peers
            .table_mut()
            .handle_heartbeat(at(9), heartbeat(2, 2, 7), second),
        Ok(HeartbeatNews::New)
    );
    assert!(peers.is_live(at(9), ModuleId(1)));
    assert_eq!(
        peers
            .table_mut()
            .handle_heartbeat(at(9), heartbeat(1, 3, 8), first),
        Err(Refusal::StaleIncarnation)
    );
}
