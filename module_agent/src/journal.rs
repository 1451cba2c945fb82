//! What the modules of a process gave to the store, and what waits until the store holds it.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::Arc;

use formation_model::{Incarnation, ModuleId, ModuleRun, Service};
use formation_protocol::{DurableState, Identity};

use crate::arguments::single_module;
use crate::store::{Contents, Entry, Store};

/// What waits until the store holds what was given to it.
enum Waiting {
    /// An agent, for the state of this number.
    Agent(ModuleId, u64),
    /// The answer to a request.
    Answer(Box<dyn FnOnce()>),
}

/// Contents that are to be written.
pub(crate) struct WriteJob {
    number: u64,
    contents: Contents,
}

impl WriteJob {
    /// Writes the contents; returns their number.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub(crate) fn run(&self, store: &Store) -> Result<u64, String> {
        store.write(self.number, &self.contents)?;
        Ok(self.number)
    }
}

/// What the modules of a process agreed on in earlier runs.
pub(crate) enum KeptMemory {
    /// A file holds it, so that it outlives the process.
    File(Journal),
    /// The process alone has it: that of each module which was hosted before.
    Process(BTreeMap<ModuleId, DurableState>),
}

impl Default for KeptMemory {
    fn default() -> Self {
        Self::Process(BTreeMap::new())
    }
}

/// The contents of a store as they are to be, which are written one after another.
pub(crate) struct Journal {
    store: Arc<Store>,
    contents: Contents,
    /// The number of changes of the contents, and of those that the store holds.
    changes: u64,
    held: u64,
    is_writing: bool,
    /// What waits until the store holds that many changes.
    waiting: VecDeque<(u64, Waiting)>,
}

impl Journal {
    /// Opens the store of a process with these modules. Those that have a store continue where it left them, after their
    /// last incarnation; those that were added by request are hosted again. In a new session those without a state have forgotten
    /// nothing.
    ///
    /// # Errors
    /// Names the file that cannot be used, and what to do.
    pub(crate) fn open(
        directory: &Path,
        name: &str,
        (session, is_new): (u32, bool),
        modules: &mut Vec<(Identity, Service)>,
    ) -> Result<Self, String> {
        let named = modules.iter().map(|(identity, _)| identity.module);
        let (store, contents) = Store::open(directory, name, session, &named.collect())?;
        let mut journal = Self {
            store: Arc::new(store),
            contents,
            changes: 0,
            held: 0,
            is_writing: false,
            waiting: VecDeque::new(),
        };
        for (&module, entry) in &journal.contents.modules {
            // One without a state was added, and its process ended before its first message.
            if let Some(state) = entry.state.as_ref().filter(|_| entry.added) {
                tracing::info!(
                    module = module.0,
                    "hosted again, as it was added by request"
                );
                modules.push((single_module(module, state.pose), state.service));
            }
        }
        for (identity, _) in modules {
            journal.restore(identity);
            identity.is_first_run = is_new && journal.state_of(identity.module).is_none();
        }
        Ok(journal)
    }

    /// Gives a module that the process hosts from its start a store, an incarnation after the last, and the body that it had.
    fn restore(&mut self, identity: &mut Identity) {
        let Some(entry) = self.contents.modules.get(&identity.module) else {
            return self.create(identity, false);
        };
        identity.has_store = true;
        let next = Incarnation(entry.incarnation.0.saturating_add(1));
        identity.incarnation = identity.incarnation.max(next);
        if let Some(state) = &entry.state {
            identity.pose = state.pose;
            identity.links.clone_from(&state.links);
        }
    }

    fn create(&mut self, identity: &mut Identity, added: bool) {
        let entry = Entry::empty(identity.incarnation, added);
        identity.has_store = true;
        self.contents.modules.insert(identity.module, entry);
    }

    /// Writes the incarnations of modules that begin a run, and returns when they are on disk: a run sends no message
    /// before. Nothing that an earlier run waited for is due any more.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    /// Enforces Q9.
    pub(crate) fn begin(&mut self, modules: &[(Identity, Service)]) -> Result<(), String> {
        for (identity, _) in modules {
            if let Some(entry) = self.contents.modules.get_mut(&identity.module) {
                entry.incarnation = identity.incarnation;
            }
        }
        self.waiting.clear();
        self.is_writing = false;
        self.changes += 1;
        self.store.write(self.changes, &self.contents)?;
        self.held = self.changes;
        Ok(())
    }

    /// The store, for the thread that writes.
    pub(crate) fn store(&self) -> Arc<Store> {
        Arc::clone(&self.store)
    }

    /// What the store has of a module.
    pub(crate) fn state_of(&self, module: ModuleId) -> Option<DurableState> {
        self.contents.modules.get(&module)?.state.clone()
    }

    /// Gives a store to a module that is added by request. It is written with the first state of its agent, which sends
    /// nothing before.
    ///
    /// # Errors
    /// A file holds its memory, or no store can be created.
    pub(crate) fn add(&mut self, identity: &mut Identity) -> Result<(), String> {
        self.store.refuse_second_file(identity.module)?;
        if self.state_of(identity.module).is_some() {
            return Err(format!(
                "{} has a store in this process, which hosts it again when it restarts",
                identity.module
            ));
        }
        self.create(identity, true);
        Ok(())
    }

    /// Takes in what the agent of a run gives to its store under this number.
    pub(crate) fn persist(&mut self, run: ModuleRun, number: u64, state: DurableState) {
        let entry = self.contents.modules.get_mut(&run.module);
        debug_assert!(entry.is_some(), "{} has a store", run.module);
        if let Some(entry) = entry {
            entry.incarnation = run.incarnation;
            entry.state = Some(state);
        }
        self.changes += 1;
        let waiting = Waiting::Agent(run.module, number);
        self.waiting.push_back((self.changes, waiting));
    }

    /// Answers a request once the store holds all that was given to it.
    pub(crate) fn answer(&mut self, answer: Box<dyn FnOnce()>) {
        if self.held == self.changes {
            answer();
        } else {
            let waiting = Waiting::Answer(answer);
            self.waiting.push_back((self.changes, waiting));
        }
    }

    /// The next contents to write; none before [`Self::finish`]. All changes until then share one write.
    pub(crate) fn next_job(&mut self) -> Option<WriteJob> {
        if self.is_writing || self.held == self.changes {
            return None;
        }
        self.is_writing = true;
        Some(WriteJob {
            number: self.changes,
            contents: self.contents.clone(),
        })
    }

    /// The store holds the contents of this number. Answers the requests that waited for them, and returns the agents that
    /// did, each with the number of its state.
    /// Enforces Q8.
    pub(crate) fn finish(&mut self, number: u64) -> Vec<(ModuleId, u64)> {
        self.is_writing = false;
        self.held = self.held.max(number);
        let mut agents = Vec::new();
        let is_held = |(needed, _): &(u64, Waiting)| *needed <= self.held;
        let count = self.waiting.iter().take_while(|one| is_held(one)).count();
        for (_, waiting) in self.waiting.drain(..count) {
            match waiting {
                Waiting::Agent(module, number) => agents.push((module, number)),
                Waiting::Answer(answer) => answer(),
            }
        }
        agents
    }
}
