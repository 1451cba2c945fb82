//! What hands have done to robots: the truth about where they put them, whatever the modules believe.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation_model::{ModuleId, Pose};

use super::Monitor;
use crate::cluster::Cluster;

/// Contact with a module within this after a hand has put it somewhere is made by the hand: the others learn of it by a message, and
/// need a moment to halt.
const REACTION: Duration = Duration::from_millis(300);

/// Within this a module that was carried off its spot no longer shows itself as settled.
const NOTICED: Duration = Duration::from_secs(15);

/// When hands last put modules somewhere, or misled them.
#[derive(Default)]
pub(super) struct Hands {
    carried: BTreeMap<ModuleId, Duration>,
    /// When a hand last tore the docked part of a module apart. Its members halt one after another.
    torn: BTreeMap<ModuleId, Duration>,
    /// When the localisation of a module last jumped.
    misled: BTreeMap<ModuleId, Duration>,
}

impl Hands {
    /// Whether a module was ever carried.
    pub fn has_carried(&self, module: ModuleId) -> bool {
        self.carried.contains_key(&module)
    }

    /// Whether a module may be measured elsewhere than it drove.
    pub fn has_moved_or_misled(&self, module: ModuleId) -> bool {
        self.has_carried(module) || self.misled.contains_key(&module)
    }

    pub fn note_misled(&mut self, module: ModuleId, at: Duration) {
        self.misled.insert(module, at);
    }

    /// Whether a module may still take itself to be where it was.
    pub fn may_be_off(&self, module: ModuleId, at: Duration) -> bool {
        let both = [self.carried.get(&module), self.misled.get(&module)];
        both.into_iter()
            .flatten()
            .any(|&since| at <= since + NOTICED)
    }

    /// Whether a hand made two modules meet.
    pub fn made_contact(&self, (one, other): (ModuleId, ModuleId), at: Duration) -> bool {
        let is_recent =
            |since: Option<&Duration>| since.is_some_and(|&since| at <= since + REACTION);
        let both = [one, other];
        both.iter()
            .any(|module| is_recent(self.carried.get(module)))
            || both.iter().all(|module| is_recent(self.torn.get(module)))
    }

    pub fn note_torn(&mut self, part: &BTreeSet<ModuleId>, at: Duration) {
        self.torn.extend(part.iter().map(|&module| (module, at)));
    }
}

impl Monitor {
    pub(super) fn note_carried(
        &mut self,
        at: Duration,
        module: ModuleId,
        pose: Pose,
        cluster: &Cluster,
    ) {
        self.hands.carried.insert(module, at);
        self.bodies.put(at, module, pose, cluster);
    }
}
