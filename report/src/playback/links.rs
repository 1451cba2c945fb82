//! The times during which modules are docked. Only links that both ends name count.

use std::collections::{BTreeMap, BTreeSet};

use formation_event_log::{ModuleSnapshot, Scene};
use serde::Serialize;

use super::track::time;
use crate::subject::Subject;

/// More spans than these are not shown; only ports that dock and undock without end have more.
const SPANS_MAX: usize = 60_000;

/// The kind of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Fate {
    Kept,
    Broken,
    New,
}

/// Two modules, the kind of their link, and the times at which it begins and ends.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Span(
    pub(crate) usize,
    pub(crate) usize,
    pub(crate) Fate,
    pub(crate) f64,
    pub(crate) Option<f64>,
);

/// The links of the film so far.
pub(super) struct Links {
    fates: BTreeMap<(usize, usize), Fate>,
    docked: BTreeMap<(usize, usize), f64>,
    /// Links that have been broken; docked again, they are new.
    broken: BTreeSet<(usize, usize)>,
    spans: Vec<Span>,
}

impl Links {
    pub(super) fn new(subject: &Subject) -> Self {
        let fate = |kept| if kept { Fate::Kept } else { Fate::Broken };
        Self {
            fates: subject
                .links
                .iter()
                .map(|link| (link.ends, fate(link.kept)))
                .collect(),
            docked: BTreeMap::new(),
            broken: BTreeSet::new(),
            spans: Vec::new(),
        }
    }

    /// A module names its links, unlike in the scene so far: those that it does not name any more end now, and those that the
    /// other end names too exist from now on.
    pub(super) fn change(
        &mut self,
        now: f64,
        module: usize,
        snapshot: &ModuleSnapshot,
        scene: &Scene,
        subject: &Subject,
    ) {
        let before = scene.snapshot(snapshot.module);
        let before = before.into_iter().flat_map(|before| &before.links);
        for gone in before.filter(|link| !snapshot.links.contains(link)) {
            if let Some(other) = subject.position_of(*gone) {
                let ends = (module.min(other), module.max(other));
                if let Some(since) = self.docked.remove(&ends) {
                    self.add(ends, since, Some(now));
                }
            }
        }
        for name in &snapshot.links {
            let Some(other) = subject.position_of(*name).filter(|&other| other != module) else {
                continue;
            };
            let is_mutual = scene
                .snapshot(*name)
                .is_some_and(|other| other.links.contains(&snapshot.module));
            if is_mutual {
                self.docked
                    .entry((module.min(other), module.max(other)))
                    .or_insert(now);
            }
        }
    }

    fn add(&mut self, ends: (usize, usize), since: f64, until: Option<f64>) {
        if self.spans.len() >= SPANS_MAX {
            return;
        }
        let fate = self.fates.get(&ends).copied().unwrap_or(Fate::New);
        let was_broken = fate == Fate::Broken && !self.broken.insert(ends);
        let fate = if was_broken { Fate::New } else { fate };
        self.spans
            .push(Span(ends.0, ends.1, fate, time(since), until.map(time)));
    }

    pub(super) fn finish(mut self) -> Vec<Span> {
        for (ends, since) in std::mem::take(&mut self.docked) {
            self.add(ends, since, None);
        }
        self.spans
    }
}
