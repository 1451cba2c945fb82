//! The whole input of one plan: what every replica must hold alike before the first turn.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use thiserror::Error;

use crate::model::{
    ConfigurationId, MODULES_MAX, ModuleId, NO_ID, PlannerParameters, Pose, SpotId, Target,
};

/// What planning has to know of one module.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct PlanningModule {
    /// The module.
    pub id: ModuleId,
    /// Where it stands.
    pub pose: Pose,
    /// The modules that it is docked to. Only links that both ends name count.
    pub links: BTreeSet<ModuleId>,
    /// The initial configuration to which it belongs, for reports; the links decide.
    pub configuration: Option<ConfigurationId>,
    /// The module that it takes for its leader.
    pub leader: Option<ModuleId>,
    /// The spot on which it has settled already and stays.
    pub pin: Option<SpotId>,
}

/// A connected group of docked modules, as its links show it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// The module that decides for all of them.
    pub leader: ModuleId,
    /// Two or more modules in ascending order.
    pub modules: Vec<ModuleId>,
}

/// Target, parameters and modules, validated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanningProblem {
    target: Arc<Target>,
    parameters: PlannerParameters,
    modules: Vec<PlanningModule>,
}

/// Why an input cannot be planned for.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ProblemError {
    /// There is no module.
    #[error("there is no module to plan for")]
    NoModules,
    /// There are more modules than the suite takes.
    #[error("{0} modules, at most {MODULES_MAX} are supported")]
    TooManyModules(usize),
    /// A module carries the identifier reserved for "none".
    #[error("module identifier {NO_ID} is reserved and cannot be used")]
    ReservedId,
    /// A module is listed twice.
    #[error("{0} is listed twice")]
    DuplicateModule(ModuleId),
    /// A module is pinned to a spot that does not exist.
    #[error("{0} is pinned to {1}, which the target does not have")]
    NoSuchPin(ModuleId, SpotId),
    /// Two modules are pinned to one spot.
    #[error("{0} and {1} are both pinned to {2}")]
    SharedPin(ModuleId, ModuleId, SpotId),
}

impl PlanningProblem {
    /// Validates an input: sorts the modules and drops links that not both ends name.
    ///
    /// # Errors
    /// Refuses empty or oversized inputs, repeated modules, and pins that contradict the target or each other.
    pub fn new(
        target: Arc<Target>,
        parameters: PlannerParameters,
        mut modules: Vec<PlanningModule>,
    ) -> Result<Self, ProblemError> {
        if modules.is_empty() {
            return Err(ProblemError::NoModules);
        }
        if modules.len() > MODULES_MAX {
            return Err(ProblemError::TooManyModules(modules.len()));
        }
        modules.sort_by_key(|module| module.id);
        if let Some(pair) = modules.windows(2).find(|pair| pair[0].id == pair[1].id) {
            return Err(ProblemError::DuplicateModule(pair[1].id));
        }
        if modules.last().is_some_and(|module| module.id.0 == NO_ID) {
            return Err(ProblemError::ReservedId);
        }
        let mut holders = BTreeMap::new();
        for module in &modules {
            let Some(spot) = module.pin else { continue };
            if target.position_of(spot).is_none() {
                return Err(ProblemError::NoSuchPin(module.id, spot));
            }
            if let Some(other) = holders.insert(spot, module.id) {
                return Err(ProblemError::SharedPin(other, module.id, spot));
            }
        }
        let named: BTreeMap<ModuleId, BTreeSet<ModuleId>> = modules
            .iter()
            .map(|module| (module.id, module.links.clone()))
            .collect();
        for module in &mut modules {
            let id = module.id;
            module.links.retain(|other| {
                *other != id && named.get(other).is_some_and(|links| links.contains(&id))
            });
        }
        Ok(Self {
            target,
            parameters,
            modules,
        })
    }

    /// The target that all modules are to form.
    #[must_use]
    pub fn target(&self) -> &Arc<Target> {
        &self.target
    }

    /// What the user chose about planning.
    #[must_use]
    pub fn parameters(&self) -> &PlannerParameters {
        &self.parameters
    }

    /// The modules in ascending order of identifier; their links are symmetric.
    #[must_use]
    pub fn modules(&self) -> &[PlanningModule] {
        &self.modules
    }

    /// The position of a module in [`Self::modules`].
    #[must_use]
    pub fn position_of(&self, id: ModuleId) -> Option<usize> {
        self.modules
            .binary_search_by_key(&id, |module| module.id)
            .ok()
    }

    /// The module of that identifier.
    #[must_use]
    pub fn module(&self, id: ModuleId) -> Option<&PlanningModule> {
        self.position_of(id).map(|position| &self.modules[position])
    }

    /// The configurations of two or more modules that are free to move, in ascending order of their lowest module.
    ///
    /// A pinned module takes no part. The leader is the member that the members name, if they name exactly one of
    /// themselves; otherwise the member nearest the target's centre, ties by identifier.
    #[must_use]
    pub fn configurations(&self) -> Vec<Configuration> {
        let mut seen = BTreeSet::new();
        let mut configurations = Vec::new();
        for module in &self.modules {
            if module.pin.is_some() || !seen.insert(module.id) {
                continue;
            }
            let mut members = vec![module.id];
            let mut next = 0;
            while let Some(member) = members.get(next).and_then(|&id| self.module(id)) {
                for &other in &member.links {
                    let free = self.module(other).is_some_and(|other| other.pin.is_none());
                    if free && seen.insert(other) {
                        members.push(other);
                    }
                }
                next += 1;
            }
            if members.len() < 2 {
                continue;
            }
            members.sort_unstable();
            configurations.push(Configuration {
                leader: self.leader_among(&members),
                modules: members,
            });
        }
        configurations
    }

    fn leader_among(&self, members: &[ModuleId]) -> ModuleId {
        let named: BTreeSet<ModuleId> = members
            .iter()
            .filter_map(|&id| self.module(id)?.leader)
            .filter(|leader| members.binary_search(leader).is_ok())
            .collect();
        match named.first() {
            Some(&leader) if named.len() == 1 => leader,
            _ => self.nearest_to_centre(members).unwrap_or(members[0]),
        }
    }

    /// The module among `members` nearest the target's centre, ties by identifier.
    #[must_use]
    pub fn nearest_to_centre(&self, members: &[ModuleId]) -> Option<ModuleId> {
        let centre = self.target.centre();
        members
            .iter()
            .filter_map(|&id| Some((self.module(id)?.pose.distance_to(&centre), id)))
            .min()
            .map(|(_, id)| id)
    }
}
