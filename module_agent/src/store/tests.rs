//! Stores that are written, damaged, shared and refused.

use std::num::NonZeroU64;

use formation::model::{
    BodyReport, Digest, Epoch, Polyline, Pose, QuorumBasis, Service, SpotId, Stop, Voter,
    VoterMemory, Whereabouts,
};
use tempfile::TempDir;

use super::*;

const SESSION: u32 = 7;

fn modules(ids: &[u32]) -> BTreeSet<ModuleId> {
    ids.iter().copied().map(ModuleId).collect()
}

fn open(directory: &TempDir, name: &str, ids: &[u32]) -> Result<(Store, Contents), String> {
    Store::open(directory.path(), name, SESSION, &modules(ids))
}

fn state() -> DurableState {
    let epoch = Epoch {
        number: u64::MAX,
        convener: ModuleId(4),
    };
    let voter = |module, memory| Voter {
        module: ModuleId(module),
        memory,
    };
    DurableState {
        entered: Some(epoch),
        highest: Some(epoch),
        founders: vec![ModuleId(4), ModuleId(5)],
        quorum_bases: vec![QuorumBasis {
            epoch,
            agreed: true,
            members: vec![
                voter(4, VoterMemory::Stored(StoreId(NonZeroU64::MAX))),
                voter(5, VoterMemory::Volatile(Incarnation(u64::MAX))),
            ],
        }],
        service: Service::Retired,
        settled_on: Some((SpotId(3), Digest(u64::MAX))),
        pose: Pose::from_units(-1.5, 2.0, 0.5).unwrap(),
        links: modules(&[5]),
        bodies: vec![BodyReport {
            module: ModuleId(6),
            incarnation: Incarnation(u64::MAX),
            epoch: Some(epoch),
            sequence: u64::MAX,
            whereabouts: Whereabouts::OnTheWay(Polyline::line(
                Pose::default(),
                Pose::from_units(0.0, 1.0, 0.0).unwrap(),
            )),
        }],
        stop: Stop {
            revision: u64::MAX,
            stopped: true,
        },
    }
}

/// Adds entries for modules, of which the first has a state.
fn fill(contents: &mut Contents, ids: &[u32]) {
    for &id in ids {
        let mut entry = Entry::empty(Incarnation(9), false).unwrap();
        entry.state = (id == ids[0]).then(state);
        contents.modules.insert(ModuleId(id), entry);
    }
}

/// A directory with a store of modules 4 and 5, and what that holds.
fn written() -> (TempDir, Contents) {
    let directory = tempfile::tempdir().unwrap();
    let (store, mut contents) = open(&directory, "modules", &[4, 5]).unwrap();
    assert!(contents.modules.is_empty());
    fill(&mut contents, &[4, 5]);
    store.write(1, &contents).unwrap();
    (directory, contents)
}

fn path(directory: &TempDir) -> PathBuf {
    directory.path().join("modules.session_7.json")
}

fn refusal(directory: &TempDir) -> String {
    let refused = open(directory, "modules", &[4, 5]).map(|_| ());
    let reason = refused.unwrap_err();
    assert!(reason.contains("modules.session_7.json: "), "{reason}");
    reason
}

#[test]
fn a_store_holds_what_was_written_last() {
    let (directory, mut contents) = written();
    let (store, found) = open(&directory, "modules", &[4, 5]).unwrap();
    assert_eq!(found, contents);
    let ids: BTreeSet<StoreId> = found.modules.values().map(|entry| entry.store).collect();
    assert_eq!(ids.len(), 2, "each module has a store of its own");
    let earlier = contents.clone();
    fill(&mut contents, &[4, 5]);
    store.write(2, &contents).unwrap();
    store.write(1, &earlier).unwrap();
    assert_eq!(read(&store.path, SESSION), Ok(Some(contents)));
}

#[test]
fn a_torn_file_is_refused_wherever_it_ends() {
    let (directory, _) = written();
    let whole = fs::read(path(&directory)).unwrap();
    for length in 0..whole.len() {
        fs::write(path(&directory), &whole[..length]).unwrap();
        let reason = refusal(&directory);
        assert!(reason.contains("is damaged"), "{length}: {reason}");
        assert!(reason.contains("begin a new session"), "{reason}");
    }
    let mut holed = whole.clone();
    holed[10..20].fill(0);
    fs::write(path(&directory), &holed).unwrap();
    assert!(refusal(&directory).contains("is damaged"));
}

#[test]
fn a_file_of_a_later_version_is_refused() {
    let (directory, _) = written();
    fs::write(path(&directory), r#"{"format": 4, "cells": []}"#).unwrap();
    let reason = refusal(&directory);
    assert!(reason.contains("has format 4"), "{reason}");
    assert!(reason.contains("use the version that wrote it"), "{reason}");
}

#[test]
fn a_file_of_other_modules_or_under_the_name_of_another_session_is_refused() {
    let (directory, _) = written();
    let reason = open(&directory, "modules", &[4]).map(|_| ()).unwrap_err();
    let expected =
        "is the store of modules 4-5, and this process hosts module 4; use another directory";
    assert!(reason.contains(expected), "{reason}");
    let renamed = directory.path().join("modules.session_8.json");
    fs::copy(path(&directory), renamed).unwrap();
    let refused = Store::open(directory.path(), "modules", 8, &modules(&[4, 5]));
    let reason = refused.map(|_| ()).unwrap_err();
    assert!(reason.contains("belongs to session 7"), "{reason}");
}

#[test]
fn another_session_begins_without_memory_and_keeps_that_of_the_first() {
    let (directory, contents) = written();
    let other = Store::open(directory.path(), "modules", 8, &modules(&[4, 5]));
    let (store, mut empty) = other.unwrap();
    assert!(empty.modules.is_empty());
    fill(&mut empty, &[4, 5]);
    store.write(1, &empty).unwrap();
    drop(store);
    let (_, found) = open(&directory, "modules", &[4, 5]).unwrap();
    assert_eq!(found, contents);
}

#[test]
fn a_module_has_one_file_in_a_session() {
    let (directory, _) = written();
    let reason = open(&directory, "module_4", &[4]).map(|_| ()).unwrap_err();
    let expected = "modules.session_7.json: holds what module 4 agreed on in session 7";
    assert!(reason.contains(expected), "{reason}");
    assert!(open(&directory, "module_6", &[6]).is_ok());
}

#[test]
fn a_store_serves_one_process_at_a_time() {
    let (directory, _) = written();
    let first = open(&directory, "modules", &[4, 5]).unwrap();
    let reason = open(&directory, "modules", &[4, 5])
        .map(|_| ())
        .unwrap_err();
    let expected = "modules.lock: another process uses it";
    assert!(reason.contains(expected), "{reason}");
    drop(first);
    assert!(open(&directory, "modules", &[4, 5]).is_ok());
}

#[test]
fn a_failed_write_names_the_file() {
    let (directory, contents) = written();
    let (store, _) = open(&directory, "modules", &[4, 5]).unwrap();
    fs::remove_dir_all(directory.path()).unwrap();
    let reason = store.write(1, &contents).unwrap_err();
    let expected = "modules.session_7.json: cannot write it: No such file";
    assert!(reason.contains(expected), "{reason}");
}
