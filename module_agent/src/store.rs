//! The file that holds what the modules of a process must not forget when the process ends.
//!
//! All modules of a process share one file, so that an epoch costs one write and not one for each module. Processes may
//! share a directory: a file is named after the modules that the arguments name, and no module may be in two files of a
//! session. It is named after the session as well, because what was agreed in one session counts in no other. A process of
//! another session begins with an empty file, and leaves that of the earlier one as it is.
//!
//! A file is written whole, under another name, synced and renamed: at any time it holds the earlier contents or the
//! later.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use formation::model::text::listed_in_full;
use formation::model::{Incarnation, ModuleId, StoreId};
use formation::protocol::DurableState;
use serde::{Deserialize, Serialize};

/// The format that this version writes, and the only one that it reads.
const FORMAT: u32 = 3;

/// A larger file is refused: 25 modules of a formation of 1,000 need some 2 MB for each quorum basis.
const FILE_BYTES_MAX: u64 = 256 << 20;

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Contents {
    format: u32,
    session: u32,
    pub modules: BTreeMap<ModuleId, Entry>,
}

/// What a file holds of one module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Drawn at random when the module had no entry.
    pub store: StoreId,
    /// Its latest run.
    pub incarnation: Incarnation,
    /// Whether it was added by request, and not named by the arguments of the process.
    pub added: bool,
    /// What its agents gave to the store; `None` before the first time.
    pub state: Option<DurableState>,
}

impl Entry {
    /// The entry of a module that never took part in the session.
    ///
    /// # Errors
    /// The operating system gives no random number.
    pub(crate) fn empty(incarnation: Incarnation, added: bool) -> Result<Self, String> {
        let random = getrandom::u64()
            .map_err(|error| format!("cannot draw the identifier of a store: {error}"))?;
        Ok(Self {
            store: StoreId(std::num::NonZeroU64::MIN | random),
            incarnation,
            added,
            state: None,
        })
    }
}

/// The format alone: other formats may have other fields.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

/// A store on disk, locked for this process.
pub(crate) struct Store {
    directory: PathBuf,
    path: PathBuf,
    session: u32,
    /// The number of the latest contents that were written.
    written: Mutex<u64>,
    /// The lock ends with the process, or with this value.
    _lock: File,
}

impl Store {
    /// Opens the store of a process; `name` is the file's, and `named` are the modules that the arguments name. The contents
    /// are empty if there is no file of this session.
    ///
    /// # Errors
    /// Names the file or directory that cannot be used, and what to do.
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
            written: Mutex::new(0),
            _lock: lock,
        };
        let empty = || Contents {
            format: FORMAT,
            session,
            modules: BTreeMap::new(),
        };
        let found = read(&store.path, session)?;
        match &found {
            Some(contents) => store.check_modules(contents, named)?,
            None => tracing::info!(
                "{}: there is no store of session {session}; these modules have not taken part in it",
                store.path.display()
            ),
        }
        for &module in named {
            store.refuse_second_file(module)?;
        }
        Ok((store, found.unwrap_or_else(empty)))
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
            if let Ok(Some(other)) = read(&path, self.session)
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
        if number <= *written {
            return Ok(());
        }
        self.replace(contents)
            .map_err(|error| failed("write", &self.path, &error))?;
        *written = number;
        Ok(())
    }

    fn replace(&self, contents: &Contents) -> io::Result<()> {
        let text = serde_json::to_vec(contents)?;
        if text.len() as u64 > FILE_BYTES_MAX {
            return Err(io::Error::other(too_large()));
        }
        let new = self.path.with_extension("json.new");
        let mut file = File::create(&new)?;
        file.write_all(&text)?;
        file.sync_all()?;
        fs::rename(&new, &self.path)?;
        File::open(&self.directory)?.sync_all()
    }
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

/// The contents of a file, if there is one.
fn read(path: &Path, session: u32) -> Result<Option<Contents>, String> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(failed("read", path, &error)),
    };
    let mut text = Vec::new();
    file.take(FILE_BYTES_MAX + 1)
        .read_to_end(&mut text)
        .map_err(|error| failed("read", path, &error))?;
    let contents = parsed(&text, session);
    let contents = contents.map_err(|reason| format!("{}: {reason}", path.display()))?;
    Ok(Some(contents))
}

fn parsed(text: &[u8], session: u32) -> Result<Contents, String> {
    const DAMAGED: &str = "it holds what these modules agreed on, so begin a new session";
    if text.len() as u64 > FILE_BYTES_MAX {
        return Err(too_large());
    }
    let damaged = |error| format!("is damaged ({error}); {DAMAGED}");
    let Format { format } = serde_json::from_slice(text).map_err(damaged)?;
    if format != FORMAT {
        return Err(format!(
            "has format {format}, and this program reads format {FORMAT} only; use the version that wrote it, or begin \
             a new session"
        ));
    }
    let contents: Contents = serde_json::from_slice(text).map_err(damaged)?;
    if contents.session != session {
        return Err(format!(
            "belongs to session {}, although its name says {session}; rename it, or begin a new session",
            contents.session
        ));
    }
    Ok(contents)
}

#[cfg(test)]
mod tests;
