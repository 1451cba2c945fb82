//! The states that the hosted modules have handled.

use std::collections::BTreeMap;

use formation_model::{Incarnation, MODULES_MAX, ModuleId, ModuleState, SourceId};

/// Which state of each module the hosted ones handled last. A process sends the states of all its modules whenever one of them
/// changes, so most of those that arrive came before. To hand each of these to each hosted module costs their number squared.
///
/// A process of one module sends each state once, so agents rely on no repetition.
#[derive(Debug, Default)]
pub(super) struct HandledStates {
    /// The run and the process that sent it, and its sequence number.
    last: BTreeMap<ModuleId, ((SourceId, Incarnation), u64)>,
}

impl HandledStates {
    /// Whether a state did not come before from this process; from now on it did.
    pub fn note(&mut self, source: SourceId, state: &ModuleState) -> bool {
        if self.last.len() >= MODULES_MAX && !self.last.contains_key(&state.module) {
            // Then agents see some states twice, which changes nothing.
            self.last.clear();
        }
        let run = (source, state.incarnation);
        let known = self.last.get(&state.module);
        let is_new =
            known.is_none_or(|&(known, sequence)| known != run || sequence < state.sequence);
        if is_new {
            self.last.insert(state.module, (run, state.sequence));
        }
        is_new
    }
}
