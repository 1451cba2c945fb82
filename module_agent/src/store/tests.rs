//! Stores that are written, damaged, shared and refused.

use formation_model::{
    BodyReport, Digest, Epoch, Polyline, Pose, Service, SpotId, Stop, Voters, Whereabouts,
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
    DurableState {
        entered: Some(epoch),
        highest: Some(epoch),
        knows: true,
        voters: Voters {
            named: vec![ModuleId(4), ModuleId(5), ModuleId(6)],
            removed: modules(&[6]),
            listed: modules(&[5]),
        },
        service: Service::Retired,
        settled_on: Some((SpotId(3), Digest(u64::MAX))),
        pose: Pose::from_units(-1.5, 2.0, 0.5).unwrap(),
        links: modules(&[5]),
        bodies: [BodyReport {
            module: ModuleId(6),
            incarnation: Incarnation(u64::MAX),
            epoch: Some(epoch),
            sequence: u64::MAX,
            whereabouts: Whereabouts::OnTheWay(Polyline::line(
                Pose::default(),
                Pose::from_units(0.0, 1.0, 0.0).unwrap(),
            )),
        }]
        .into(),
        stop: Stop {
            revision: u64::MAX,
            stopped: true,
        },
    }
}

/// What a store has on disk.
fn held(store: &Store) -> Contents {
    read(&store.path, SESSION).unwrap().unwrap().1
}

/// Adds entries for modules, of which the first has a state.
fn fill(contents: &mut Contents, ids: &[u32]) {
    for &id in ids {
        let mut entry = Entry::empty(Incarnation(9), false);
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
    let earlier = contents.clone();
    fill(&mut contents, &[4, 5]);
    store.write(2, &contents).unwrap();
    store.write(1, &earlier).unwrap();
    assert_eq!(held(&store), contents);
}

/// The names and sizes of the shared files.
fn shared_files(directory: &TempDir) -> BTreeMap<String, u64> {
    let entries = fs::read_dir(directory.path()).unwrap().map(Result::unwrap);
    let files = entries.map(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        (name, entry.metadata().unwrap().len())
    });
    files.filter(|(name, _)| name.contains("shared")).collect()
}

/// The contents of a store in which these modules have these states.
fn holding(states: &[(u32, &DurableState)]) -> Contents {
    let mut contents = Contents {
        session: SESSION,
        modules: BTreeMap::new(),
    };
    for &(id, state) in states {
        fill(&mut contents, &[id]);
        let entry = contents.modules.get_mut(&ModuleId(id)).unwrap();
        entry.state = Some(state.clone());
    }
    contents
}

/// Shows Q9.
#[test]
fn what_modules_know_of_all_others_is_stored_once_and_written_only_when_it_changes() {
    let directory = tempfile::tempdir().unwrap();
    let (store, _) = open(&directory, "modules", &[4, 5]).unwrap();
    let mut common = state();
    common.voters.named = (0..1_000).map(ModuleId).collect();
    let mut moved = common.clone();
    moved.pose = Pose::default();
    let mut other = moved.clone();
    other.voters.removed.clear();
    let mut sizes = Vec::new();
    let steps = [&common, &common, &moved, &other];
    for (number, fifth) in (1..).zip(steps) {
        let contents = match number {
            1 => holding(&[(4, &common)]),
            _ => holding(&[(4, &common), (5, fifth)]),
        };
        store.write(number, &contents).unwrap();
        assert_eq!(held(&store), contents, "{number}");
        let shared = shared_files(&directory);
        assert_eq!(shared.len(), 1, "{shared:?}");
        sizes.extend(shared);
    }
    assert_eq!(sizes[0].1, sizes[1].1, "the second module knows the same");
    assert_eq!(sizes[1], sizes[2], "it only moved");
    assert!(sizes[3].1 > 2 * sizes[0].1 - 1_000, "{sizes:?}");
    assert_ne!(sizes[2].0, sizes[3].0, "a new name for a new version");
}

#[test]
fn a_shared_file_that_is_no_longer_named_does_not_stay() {
    let (directory, contents) = written();
    let shared = directory.path().join("modules.session_7.shared_1.json");
    let before = fs::read(&shared).unwrap();
    let (store, _) = open(&directory, "modules", &[4, 5]).unwrap();
    store.write(1, &contents).unwrap();
    drop(store);
    // As after an end between the replacement and the removal.
    fs::write(&shared, before).unwrap();
    let (_store, found) = open(&directory, "modules", &[4, 5]).unwrap();
    assert_eq!(found, contents);
    let left: Vec<String> = shared_files(&directory).into_keys().collect();
    assert_eq!(left, ["modules.session_7.shared_2.json"]);
}

/// Shows Q9.
#[test]
fn a_module_takes_over_what_others_of_its_process_know_of_bodies_but_not_of_its_own() {
    let directory = tempfile::tempdir().unwrap();
    let (store, _) = open(&directory, "modules", &[5, 6]).unwrap();
    let report = |module, sequence| BodyReport {
        module: ModuleId(module),
        incarnation: Incarnation(1),
        epoch: None,
        sequence,
        whereabouts: Whereabouts::Seen(Pose::default()),
    };
    let mut fifth = state();
    fifth.bodies = [report(6, 1), report(7, 2), report(8, 1)].into();
    let mut sixth = state();
    sixth.bodies = [report(5, 1), report(7, 1)].into();
    store
        .write(1, &holding(&[(5, &fifth), (6, &sixth)]))
        .unwrap();
    let found = held(&store);
    let bodies = |id| found.modules[&ModuleId(id)].state.clone().unwrap().bodies;
    assert_eq!(*bodies(5), [report(6, 1), report(7, 2), report(8, 1)]);
    assert_eq!(*bodies(6), [report(5, 1), report(7, 2), report(8, 1)]);
}

/// Shows Q10.
#[test]
fn a_shared_file_that_is_missing_or_damaged_is_refused() {
    let (directory, _) = written();
    let shared = directory.path().join("modules.session_7.shared_1.json");
    let whole = fs::read(&shared).unwrap();
    for damage in [&whole[..whole.len() / 2], b"{\"known\":[],\"bodies\":{}}"] {
        fs::write(&shared, damage).unwrap();
        let refused = open(&directory, "modules", &[4, 5]).map(|_| ());
        let reason = refused.unwrap_err();
        assert!(reason.contains("shared_1.json: is damaged"), "{reason}");
    }
    fs::remove_file(&shared).unwrap();
    let refused = open(&directory, "modules", &[4, 5]).map(|_| ());
    assert!(refused.unwrap_err().contains("it is missing"));
}

/// Shows Q10.
#[test]
fn a_file_that_is_missing_next_to_its_shared_file_is_refused() {
    let (directory, _) = written();
    fs::remove_file(path(&directory)).unwrap();
    let reason = refusal(&directory);
    assert!(reason.contains("shared_1.json shows"), "{reason}");

    // As after an end in the first write, which is made before the modules take part.
    let directory = tempfile::tempdir().unwrap();
    let (store, mut contents) = open(&directory, "modules", &[4, 5]).unwrap();
    for id in [4, 5] {
        let entry = Entry::empty(Incarnation(9), false);
        contents.modules.insert(ModuleId(id), entry);
    }
    store.write(1, &contents).unwrap();
    drop(store);
    fs::remove_file(path(&directory)).unwrap();
    let (_store, found) = open(&directory, "modules", &[4, 5]).unwrap();
    assert!(found.modules.is_empty());
}

/// Shows Q10.
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

/// Each is still valid JSON, of the same fields.
/// Shows Q10.
#[test]
fn a_file_of_which_a_digit_has_changed_is_refused() {
    let (directory, _) = written();
    let shared = directory.path().join("modules.session_7.shared_1.json");
    for changed in [path(&directory), shared] {
        let whole = fs::read(&changed).unwrap();
        let end = whole.iter().position(|&byte| byte == b'\n').unwrap();
        for position in (0..end).filter(|&position| whole[position].is_ascii_digit()) {
            let mut other = whole.clone();
            other[position] ^= 1;
            fs::write(&changed, &other).unwrap();
            assert!(open(&directory, "modules", &[4, 5]).is_err(), "{position}");
        }
        fs::write(&changed, &whole).unwrap();
        open(&directory, "modules", &[4, 5]).unwrap();
    }
}

#[test]
fn a_file_of_a_later_version_is_refused() {
    let (directory, _) = written();
    fs::write(path(&directory), r#"{"format": 7, "cells": []}"#).unwrap();
    let reason = refusal(&directory);
    assert!(reason.contains("has format 7"), "{reason}");
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
