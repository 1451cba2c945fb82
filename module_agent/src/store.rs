//! The file that holds what the modules of a process must not forget when the process ends.
//!
//! All modules of a process share one file, so that an epoch costs one write and not one for each module. Processes may
//! share a directory: a file is named after the modules that the arguments name, and no module may be in two files of a
//! session. It is named after the session as well, because what was agreed in one session counts in no other. A process of
//! another session begins with an empty file, and leaves that of the earlier one as it is.
//!
//! A file is written whole, under another name, synced and renamed: at any time it holds the earlier contents or the
//! later. A line of JSON is followed by its checksum, so that a disk that returns other bytes than it was given is noticed. What
//! modules know of all others is in a second file, because it grows with the formation and seldom changes. Each
//! version of that has a name of its own, which the first file gives, so that both change at once.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use formation_model::text::listed_in_full;
use formation_model::{BodyReport, Incarnation, ModuleId, Voters};
use formation_protocol::DurableState;
use serde::{Deserialize, Serialize};

/// The format that this version writes, and the only one that it reads.
const FORMAT: u32 = 6;

/// A larger file is refused.
const FILE_BYTES_MAX: u64 = 256 << 20;

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Contents {
    session: u32,
    pub modules: BTreeMap<ModuleId, Entry>,
}

/// The file of a process. It is written whenever a module sets off or stops, so it lacks what grows with the formation.
#[derive(Serialize, Deserialize)]
struct Packed {
    format: u32,
    session: u32,
    /// The number of the file that has the rest.
    shared: u64,
    modules: BTreeMap<ModuleId, PackedEntry>,
}

/// An entry whose state lacks what the shared file has, with the position in [`Shared::voters`].
#[derive(Serialize, Deserialize)]
struct PackedEntry {
    entry: Entry,
    voters: Option<usize>,
}

/// What the modules of a process know of all others, once for all of them: otherwise it would grow with the modules of the process
/// times those of the formation.
#[derive(Default, Serialize, Deserialize)]
struct Shared {
    voters: Vec<Voters>,
    /// The latest report on each body that any of the modules knows.
    bodies: BTreeMap<ModuleId, BodyReport>,
}

/// What makes up the shared file that was written last.
#[derive(Default)]
struct SharedParts {
    voters: Vec<Voters>,
    bodies: Vec<Arc<[BodyReport]>>,
}

impl PartialEq for SharedParts {
    /// Most lists of bodies are those that were written last, and not only equal to them.
    fn eq(&self, other: &Self) -> bool {
        let mut bodies = self.bodies.iter().zip(&other.bodies);
        self.voters == other.voters
            && self.bodies.len() == other.bodies.len()
            && bodies.all(|(one, other)| Arc::ptr_eq(one, other) || one == other)
    }
}

impl SharedParts {
    /// Takes out of entries what the shared file has.
    fn of(modules: &BTreeMap<ModuleId, Entry>) -> (Self, BTreeMap<ModuleId, PackedEntry>) {
        let mut parts = Self::default();
        let pack = |(&module, entry): (&ModuleId, &Entry)| {
            let mut entry = entry.clone();
            let voters = entry.state.as_mut().map(|state| parts.take(state));
            (module, PackedEntry { entry, voters })
        };
        let packed = modules.iter().map(pack).collect();
        (parts, packed)
    }

    /// Takes its part out of a state; returns its position in `voters`.
    fn take(&mut self, state: &mut DurableState) -> usize {
        self.bodies.push(std::mem::take(&mut state.bodies));
        let voters = std::mem::take(&mut state.voters);
        let position = self.voters.iter().position(|other| *other == voters);
        position.unwrap_or_else(|| {
            self.voters.push(voters);
            self.voters.len() - 1
        })
    }

    fn shared(&self) -> Shared {
        let mut bodies: BTreeMap<ModuleId, BodyReport> = BTreeMap::new();
        for report in self.bodies.iter().flat_map(|reports| reports.iter()) {
            let known = bodies.get(&report.module);
            if known.is_none_or(|known| known.compare_age(report).is_lt()) {
                bodies.insert(report.module, report.clone());
            }
        }
        Shared {
            voters: self.voters.clone(),
            bodies,
        }
    }
}

impl Packed {
    /// The contents; `None` if the shared file lacks what an entry names.
    fn unpacked(self, shared: &Shared) -> Option<Contents> {
        let unpacked = |(module, PackedEntry { mut entry, voters })| {
            if let Some(state) = &mut entry.state {
                state.voters.clone_from(shared.voters.get(voters?)?);
                let others = shared.bodies.values();
                let others = others.filter(|body| body.module != module);
                state.bodies = others.cloned().collect();
            }
            Some((module, entry))
        };
        let modules = self.modules.into_iter().map(unpacked);
        Some(Contents {
            session: self.session,
            modules: modules.collect::<Option<_>>()?,
        })
    }
}

/// What a file holds of one module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Its latest run.
    pub incarnation: Incarnation,
    /// Whether it was added by request, and not named by the arguments of the process.
    pub added: bool,
    /// What its agents gave to the store; `None` before the first time.
    pub state: Option<DurableState>,
}

impl Entry {
    /// The entry of a module that never took part in the session.
    pub(crate) fn empty(incarnation: Incarnation, added: bool) -> Self {
        Self {
            incarnation,
            added,
            state: None,
        }
    }
}

/// The format alone: other formats may have other fields.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

/// What a store has on disk.
#[derive(Default)]
struct Written {
    /// The number of the latest contents that were written.
    number: u64,
    /// The number of the shared file, and what it has; `None` before this process has written it.
    shared: u64,
    parts: Option<SharedParts>,
}

/// A store on disk, locked for this process.
pub(crate) struct Store {
    directory: PathBuf,
    path: PathBuf,
    session: u32,
    written: Mutex<Written>,
    /// The lock ends with the process, or with this value.
    _lock: File,
}

impl Store {
    /// Opens the store of a process; `name` is the file's, and `named` are the modules that the arguments name. The contents
    /// are empty if there is no file of this session.
    ///
    /// # Errors
    /// Names the file or directory that cannot be used, and what to do.
    /// Enforces Q10.
    pub(crate) fn open(
        directory: &Path,
        name: &str,
        session: u32,
        named: &BTreeSet<ModuleId>,
    ) -> Result<(Self, Contents), String> {
        fs::create_dir_all(directory).map_err(|error| failed("create", directory, &error))?;
        let lock = locked(&directory.join(format!("{name}.lock")))?;
        let store = Self {
            directory: directory.to_owned(),
            path: directory.join(format!("{name}{}", suffix(session))),
            session,
            written: Mutex::default(),
            _lock: lock,
        };
        let empty = || Contents {
            session,
            modules: BTreeMap::new(),
        };
        let found = read(&store.path, session)?;
        let found = found.map(|(shared, contents)| {
            let mut written = store.written.lock().unwrap_or_else(PoisonError::into_inner);
            written.shared = shared;
            // The process may have ended before it had removed the one before.
            store.remove_shared(shared.saturating_sub(1));
            contents
        });
        match &found {
            Some(contents) => store.check_modules(contents, named)?,
            None => {
                store.refuse_a_shared_file()?;
                tracing::info!(
                    "{}: there is no store of session {session}; these modules have not taken part in it",
                    store.path.display()
                );
            }
        }
        for &module in named {
            store.refuse_second_file(module)?;
        }
        Ok((store, found.unwrap_or_else(empty)))
    }

    /// Refuses to begin without the file if the shared one is there: the modules have taken part, and would not know it. A process
    /// that ended in its first write has left a shared file with nothing in it.
    fn refuse_a_shared_file(&self) -> Result<(), String> {
        let begin = self.path.with_extension("shared_");
        let begin = begin.to_string_lossy();
        let failed = |error| failed("read", &self.directory, &error);
        for entry in fs::read_dir(&self.directory).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let other = path.to_string_lossy();
            if !other.starts_with(&*begin) || !other.ends_with(".json") {
                continue;
            }
            let text = text_of(&path)?.unwrap_or_default();
            let shared = checked(&text).ok().map(serde_json::from_slice::<Shared>);
            let is_empty = |shared: &Shared| shared.voters.is_empty() && shared.bodies.is_empty();
            if !shared.is_some_and(|shared| shared.is_ok_and(|shared| is_empty(&shared))) {
                return Err(format!(
                    "{}: is missing, and {other} shows that these modules have agreed on something; restore it, or \
                     begin a new session",
                    self.path.display()
                ));
            }
        }
        Ok(())
    }

    /// Refuses the contents of a process that hosted other modules.
    fn check_modules(&self, contents: &Contents, named: &BTreeSet<ModuleId>) -> Result<(), String> {
        let entries = contents.modules.iter();
        let stored = entries.filter(|(_, entry)| !entry.added);
        let stored: BTreeSet<ModuleId> = stored.map(|(&module, _)| module).collect();
        if stored == *named {
            return Ok(());
        }
        let listed = |modules: &BTreeSet<ModuleId>| listed_in_full(modules.iter().copied());
        Err(format!(
            "{}: is the store of {}, and this process hosts {}; use another directory, or host the same modules",
            self.path.display(),
            listed(&stored),
            listed(named)
        ))
    }

    /// Refuses a module of which another file in the directory holds a memory of this session.
    ///
    /// # Errors
    /// Names the file.
    pub(crate) fn refuse_second_file(&self, module: ModuleId) -> Result<(), String> {
        let failed = |error| failed("read", &self.directory, &error);
        for entry in fs::read_dir(&self.directory).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path == self.path || !name.ends_with(&suffix(self.session)) {
                continue;
            }
            // A file that cannot be read is reported by the process to which it belongs.
            if let Ok(Some(text)) = text_of(&path)
                && let Ok(other) = parsed(&text, self.session)
                && other.modules.contains_key(&module)
            {
                return Err(format!(
                    "{}: holds what {module} agreed on in session {}; host it in the process of that file, or begin a \
                     new session",
                    path.display(),
                    self.session
                ));
            }
        }
        Ok(())
    }

    /// Writes contents, and returns when they are on disk. Contents with a lower number than those that are there are not
    /// written, as the later ones include them.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub(crate) fn write(&self, number: u64, contents: &Contents) -> Result<(), String> {
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if number <= written.number {
            return Ok(());
        }
        self.replace(contents, &mut written)
            .map_err(|error| failed("write", &self.path, &error))?;
        written.number = number;
        Ok(())
    }

    /// Writes the shared file under a new number if it has changed, and then the file that names it.
    /// Enforces Q9.
    fn replace(&self, contents: &Contents, written: &mut Written) -> io::Result<()> {
        let (parts, modules) = SharedParts::of(&contents.modules);
        let is_new = written.parts.as_ref() != Some(&parts);
        let former = written.shared;
        if is_new {
            written.shared += 1;
            write_whole(&shared_path(&self.path, written.shared), &parts.shared())?;
            // It has its name for good before the other file gives that name.
            File::open(&self.directory)?.sync_all()?;
            written.parts = Some(parts);
        }
        let packed = Packed {
            format: FORMAT,
            session: contents.session,
            shared: written.shared,
            modules,
        };
        write_whole(&self.path, &packed)?;
        File::open(&self.directory)?.sync_all()?;
        if is_new {
            self.remove_shared(former);
        }
        Ok(())
    }

    /// Removes a shared file that is no longer named; one that cannot be removed takes room and nothing else.
    fn remove_shared(&self, number: u64) {
        let _ = fs::remove_file(shared_path(&self.path, number));
    }
}

/// Writes a file and its checksum under another name, syncs it, and renames it.
fn write_whole(path: &Path, content: &impl Serialize) -> io::Result<()> {
    let mut text = serde_json::to_vec(content)?;
    let checksum = checksum(&text);
    writeln!(text, "\n{checksum}")?;
    if text.len() as u64 > FILE_BYTES_MAX {
        return Err(io::Error::other(too_large()));
    }
    let new = path.with_extension("json.new");
    let mut file = File::create(&new)?;
    file.write_all(&text)?;
    file.sync_all()?;
    fs::rename(&new, path)
}

/// The file of this number that has what the modules of another file know of all others.
fn shared_path(path: &Path, number: u64) -> PathBuf {
    path.with_extension(format!("shared_{number}.json"))
}

/// What the name of a file of this session ends with.
fn suffix(session: u32) -> String {
    format!(".session_{session}.json")
}

fn failed(what: &str, path: &Path, error: &io::Error) -> String {
    format!("{}: cannot {what} it: {error}", path.display())
}

fn too_large() -> String {
    format!("it has more than {FILE_BYTES_MAX} bytes")
}

/// Locks a file, which no other process can lock before this one ends.
fn locked(path: &Path) -> Result<File, String> {
    let file = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(path)
        .map_err(|error| failed("open", path, &error))?;
    file.try_lock().map_err(|error| match error {
        TryLockError::WouldBlock => format!(
            "{}: another process uses it; end that process, or use another directory",
            path.display()
        ),
        TryLockError::Error(error) => failed("lock", path, &error),
    })?;
    Ok(file)
}

/// The contents of a file, if there is one, and the number of the shared file that it names.
fn read(path: &Path, session: u32) -> Result<Option<(u64, Contents)>, String> {
    let Some(text) = text_of(path)? else {
        return Ok(None);
    };
    let packed = parsed(&text, session);
    let packed = packed.map_err(|reason| format!("{}: {reason}", path.display()))?;
    let number = packed.shared;
    let path = shared_path(path, number);
    let refused = |reason: &dyn fmt::Display| format!("{}: {}", path.display(), damaged(reason));
    let text = text_of(&path)?.ok_or_else(|| refused(&"it is missing"))?;
    let text = checked(&text).map_err(|reason| refused(&reason))?;
    let shared: Shared = serde_json::from_slice(text).map_err(|error| refused(&error))?;
    let contents = packed.unpacked(&shared);
    let contents = contents.ok_or_else(|| refused(&"it lacks what a module knows"))?;
    Ok(Some((number, contents)))
}

/// The bytes of a file, if there is one.
fn text_of(path: &Path) -> Result<Option<Vec<u8>>, String> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(failed("read", path, &error)),
    };
    let mut text = Vec::new();
    file.take(FILE_BYTES_MAX + 1)
        .read_to_end(&mut text)
        .map_err(|error| failed("read", path, &error))?;
    if text.len() as u64 > FILE_BYTES_MAX {
        return Err(format!("{}: {}", path.display(), too_large()));
    }
    Ok(Some(text))
}

/// The last line of a file.
fn checksum(content: &[u8]) -> String {
    format!("{:08x}", crc32fast::hash(content))
}

/// The content of a file: its first line, if the second is the checksum of that.
fn checked(text: &[u8]) -> Result<&[u8], String> {
    let content = first_line(text);
    let rest = &text[content.len()..];
    match rest == format!("\n{}\n", checksum(content)).as_bytes() {
        true => Ok(content),
        false => Err("its checksum is wrong or missing".to_owned()),
    }
}

fn first_line(text: &[u8]) -> &[u8] {
    text.split(|&byte| byte == b'\n').next().unwrap_or(text)
}

fn damaged(reason: &dyn fmt::Display) -> String {
    format!("is damaged ({reason}); it holds what these modules agreed on, so begin a new session")
}

fn parsed(text: &[u8], session: u32) -> Result<Packed, String> {
    let Format { format } =
        serde_json::from_slice(first_line(text)).map_err(|error| damaged(&error))?;
    if format != FORMAT {
        return Err(format!(
            "has format {format}, and this program reads format {FORMAT} only; use the version that wrote it, or begin \
             a new session"
        ));
    }
    let text = checked(text).map_err(|reason| damaged(&reason))?;
    let packed: Packed = serde_json::from_slice(text).map_err(|error| damaged(&error))?;
    if packed.session != session {
        return Err(format!(
            "belongs to session {}, although its name says {session}; rename it, or begin a new session",
            packed.session
        ));
    }
    Ok(packed)
}

#[cfg(test)]
mod tests;
