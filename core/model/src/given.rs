//! An allocation that was computed elsewhere: the table of the policy `given`.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{Assignment, FieldError, MODULES_MAX, ModuleId, SpotId, Topology};

/// A module and its spot as they stand in a file, not yet checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a module with its spot")]
pub struct RawGivenSpot {
    /// The module's identifier.
    pub module: u32,
    /// The spot's identifier.
    pub spot: u32,
}

/// An allocation as it stands in a file or a message, not yet checked.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawGiven {
    /// Who takes which spot.
    pub allocation: Vec<RawGivenSpot>,
    /// The modules that leave their configuration.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub detached: Vec<u32>,
}

impl RawGiven {
    /// Its lines in the section `target` of a scenario file.
    #[must_use]
    pub fn to_yaml(&self) -> String {
        let mut text = "  allocation:\n".to_owned();
        for RawGivenSpot { module, spot } in &self.allocation {
            text.push_str(&format!("    - {{module: {module}, spot: {spot}}}\n"));
        }
        if !self.detached.is_empty() {
            text.push_str(&format!("  detached: {:?}\n", self.detached));
        }
        text
    }
}

/// Who takes which spot of a target: each module once, each spot once, all spots those of the target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenAllocation {
    spots: BTreeMap<ModuleId, SpotId>,
    detached: BTreeSet<ModuleId>,
}

impl GivenAllocation {
    /// Validates an allocation for a target, of which `has_spot` knows the spots.
    ///
    /// # Errors
    /// Names the entry, and what is wrong with it.
    pub fn new(raw: &RawGiven, has_spot: impl Fn(SpotId) -> bool) -> Result<Self, FieldError> {
        for (field, count) in [
            ("allocation", raw.allocation.len()),
            ("detached", raw.detached.len()),
        ] {
            if count > MODULES_MAX {
                let reason = format!("{count} entries; at most {MODULES_MAX} are supported");
                return Err(FieldError::new(field, reason));
            }
        }
        let mut spots = BTreeMap::new();
        let mut holders = BTreeMap::new();
        for (index, entry) in raw.allocation.iter().enumerate() {
            let (module, spot) = (ModuleId(entry.module), SpotId(entry.spot));
            let refuse = |part: &str, reason: String| {
                let field = format!("allocation[{index}].{part}");
                Err(FieldError::new(field, reason))
            };
            if !has_spot(spot) {
                return refuse("spot", format!("{spot} is not in the target"));
            }
            if let Some(other) = spots.insert(module, spot) {
                return refuse(
                    "module",
                    format!("{module} is listed twice: it has {other}"),
                );
            }
            if let Some(other) = holders.insert(spot, module) {
                return refuse("spot", format!("{spot} is given twice: {other} has it"));
            }
        }
        let mut detached = BTreeSet::new();
        for (index, &module) in raw.detached.iter().enumerate() {
            if !detached.insert(ModuleId(module)) {
                let reason = format!("{} is listed twice", ModuleId(module));
                return Err(FieldError::new(format_args!("detached[{index}]"), reason));
            }
        }
        Ok(Self { spots, detached })
    }

    /// The spot of each module that gets one.
    #[must_use]
    pub fn spots(&self) -> &BTreeMap<ModuleId, SpotId> {
        &self.spots
    }

    /// The modules that leave their configuration.
    #[must_use]
    pub fn detached(&self) -> &BTreeSet<ModuleId> {
        &self.detached
    }

    /// The allocation as it stands in files and messages.
    #[must_use]
    pub fn to_raw(&self) -> RawGiven {
        let spots = self.spots.iter().map(|(module, spot)| RawGivenSpot {
            module: module.0,
            spot: spot.0,
        });
        RawGiven {
            allocation: spots.collect(),
            detached: self.detached.iter().map(|module| module.0).collect(),
        }
    }

    /// Each module with its spot, ascending by module.
    pub fn assignments(&self) -> impl Iterator<Item = Assignment> + '_ {
        let spots = self.spots.iter();
        spots.map(|(&module, &spot)| Assignment { module, spot })
    }
}

/// Why an allocation cannot be carried out by these modules. Nothing moves.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Error)]
pub enum GivenRefused {
    /// It names a module that takes no part.
    #[error("target.allocation: {0} takes no part; announce an allocation for the modules that do")]
    NoSuchModule(ModuleId),
    /// It leaves a module without a spot, although there are enough.
    #[error("target.allocation: {0} is missing, although there are spots for all modules")]
    Missing(ModuleId),
    /// It leaves a spot empty, although there are enough modules.
    #[error("target.allocation: {0} stays empty, although there are modules for all spots")]
    Empty(SpotId),
    /// Walls or bodies leave the module no way to the target.
    #[error(
        "target.allocation: {0} cannot reach {1}: walls or bodies leave it no way to the target"
    )]
    Unreachable(ModuleId, SpotId),
    /// The spot is blocked by the body of a module that takes no part.
    #[error("target.allocation: {0} cannot take {1}, on which a body stands")]
    Blocked(ModuleId, SpotId),
    /// A module that has settled on a spot is to leave it.
    #[error("target.allocation: {module} has settled on {pin} and stays there; {}", match given { Some(given) => format!("{given} is given to it"), None => "it is not listed".to_owned() })]
    Settled {
        /// The module.
        module: ModuleId,
        /// Its spot.
        pin: SpotId,
        /// The spot that is given to it.
        given: Option<SpotId>,
    },
    /// Two modules of a configuration stay in it and lose the link between them.
    #[error(
        "target.allocation: {0} and {1} are docked, but their spots are not adjacent; list in target.detached those that leave \
         their configuration"
    )]
    Torn(ModuleId, ModuleId),
    /// A module of a configuration gets no spot and is to stay in it.
    #[error("target.detached: {0} gets no spot, so it leaves its configuration; list it")]
    Unplaced(ModuleId),
    /// The modules that stay in a configuration are linked by those alone that leave.
    #[error(
        "target.detached: {0} and {1} stay in one configuration, but all that links them leaves; list one of them"
    )]
    Unlinked(ModuleId, ModuleId),
    /// It lists a module as detached that takes no part.
    #[error("target.detached: {0} takes no part")]
    NoSuchDetached(ModuleId),
    /// The filled spots are in several parts.
    #[error(
        "target.allocation: {0} and {1} are filled, but not joined by filled spots; planner.keep_all_spots allows that"
    )]
    Apart(SpotId, SpotId),
}

/// The groups of some docked modules that stay docked where `spot_of` puts them; groups and members ascend. A link is kept if
/// its ends take adjacent spots.
pub fn kept_groups(
    links: &Topology,
    target: &Topology,
    spot_of: impl Fn(usize) -> Option<usize>,
) -> Vec<Vec<usize>> {
    let is_kept = |&(one, other): &(usize, usize)| matches!((spot_of(one), spot_of(other)), (Some(one), Some(other)) if target.has_edge(one, other));
    let kept: Vec<(usize, usize)> = links.edges().iter().copied().filter(is_kept).collect();
    Topology::new(links.node_count(), &kept).components()
}

/// The largest of some groups; of equally large ones, the first.
pub fn largest_group(groups: Vec<Vec<usize>>) -> Vec<usize> {
    let groups = groups.into_iter().rev();
    groups.max_by_key(Vec::len).unwrap_or_default()
}
