//! The input of one plan, which every replica holds alike before the first turn.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use thiserror::Error;

use crate::{
    Area, CELL_UNREACHED, FreeCells, GivenRefused, MODULES_MAX, ModuleId, NO_ID, PlannerParameters,
    PlanningModule, Policy, SpotId, Spread, Target, Topology,
};

/// A connected group of docked modules, found from their links.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// The module that publishes the decisions on all of them.
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
    /// Modules that take no spot and make way where they stand on one.
    making_room: Vec<PlanningModule>,
    /// What the bodies of modules cover that take no part.
    bodies: Vec<Area>,
    /// Whether no way leads from each module to the target; empty if one leads from all.
    cut_off: Vec<bool>,
}

/// Why an input cannot be planned for.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ProblemError {
    /// There is no module.
    #[error("there is no module to plan for")]
    NoModules,
    /// There are more than [`MODULES_MAX`] modules.
    #[error("{0} modules; at most {MODULES_MAX} are supported")]
    TooManyModules(usize),
    /// A module has the identifier reserved for "none".
    #[error("module identifier {NO_ID} is reserved")]
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
    /// The modules cannot carry out the allocation that the target gives.
    #[error(transparent)]
    Given(#[from] GivenRefused),
}

impl PlanningProblem {
    /// Validates an input, sorts the modules, and drops links that only one end names.
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
        // The links that modules name, turned round: from the module named to the one that names it.
        let named: BTreeSet<(ModuleId, ModuleId)> = modules
            .iter()
            .flat_map(|module| module.links.iter().map(|&other| (other, module.id)))
            .collect();
        for module in &mut modules {
            let id = module.id;
            module
                .links
                .retain(|&other| other != id && named.contains(&(id, other)));
        }
        let cut_off = cut_off(&target, &modules, &[]);
        Ok(Self {
            target,
            parameters,
            modules,
            making_room: Vec::new(),
            bodies: Vec::new(),
            cut_off,
        })
    }

    /// The same problem where bodies of modules that take no part stand in the way.
    #[must_use]
    pub fn with_bodies(mut self, bodies: Vec<Area>) -> Self {
        self.cut_off = cut_off(&self.target, &self.modules, &bodies);
        self.bodies = bodies;
        self
    }

    /// The same problem where these modules stand on spots and make way for those that take them.
    #[must_use]
    pub fn with_making_room(mut self, modules: Vec<PlanningModule>) -> Self {
        self.making_room = modules;
        self
    }

    /// The modules that take no spot and make way where they stand on one.
    pub fn making_room(&self) -> &[PlanningModule] {
        &self.making_room
    }

    /// The same problem with those that make way among the modules, for the motion.
    ///
    /// # Errors
    /// Refuses a module that is listed twice, or too many.
    pub fn of_all_that_move(&self) -> Result<Self, ProblemError> {
        let making_room = self
            .making_room
            .iter()
            .cloned()
            .map(|module| PlanningModule {
                pin: None,
                ..module
            });
        let modules = self.modules.iter().cloned().chain(making_room).collect();
        let problem = Self::new(Arc::clone(&self.target), self.parameters, modules)?;
        Ok(problem.with_bodies(self.bodies.clone()))
    }

    /// The same problem without the pins to some spots.
    pub fn without_pins(&self, released: &BTreeSet<SpotId>) -> Self {
        let mut problem = self.clone();
        for module in &mut problem.modules {
            module.pin = module.pin.filter(|pin| !released.contains(pin));
        }
        problem
    }

    /// The same problem with another spread.
    #[must_use]
    pub fn with_spread(&self, spread: Spread) -> Self {
        let mut problem = self.clone();
        problem.parameters.spread = spread;
        problem
    }

    /// The same problem with other parameters.
    #[must_use]
    pub fn with_parameters(&self, parameters: PlannerParameters) -> Self {
        let mut problem = self.clone();
        if parameters.policy != Policy::Given && self.target.given().is_some() {
            problem.target = Arc::new(Target::clone(&self.target).without_given());
        }
        problem.parameters = parameters;
        problem
    }

    /// The same problem under the policy `given`, for the same target with an allocation.
    pub(crate) fn under_given(&self, target: Arc<Target>) -> Self {
        let mut problem = self.clone();
        problem.target = target;
        problem.parameters = self.parameters.under(Policy::Given);
        problem
    }

    /// What the bodies of modules cover that take no part.
    pub fn bodies(&self) -> &[Area] {
        &self.bodies
    }

    /// The cells through which ways lead; `None` if no obstacle, wall, body or settled module is in the way of any, or if the
    /// target is off a lattice.
    #[must_use]
    pub fn free_cells(&self) -> Option<FreeCells> {
        FreeCells::around(&self.target, &self.modules, &self.bodies)
    }

    /// Whether obstacles, walls and bodies leave the module at this position no way to the target. It is no candidate for
    /// any spot.
    pub fn is_cut_off(&self, position: usize) -> bool {
        self.cut_off.get(position).copied().unwrap_or_default()
    }

    /// The number of modules that are candidates.
    pub fn candidate_count(&self) -> usize {
        let cut_off = self.cut_off.iter().filter(|&&is_cut_off| is_cut_off);
        self.modules.len() - cut_off.count()
    }

    /// The number of spots that the candidates can fill.
    pub fn fillable_count(&self) -> usize {
        self.candidate_count().min(self.target.spots().len())
    }

    /// The target to form.
    pub fn target(&self) -> &Arc<Target> {
        &self.target
    }

    /// The user's choices about planning.
    pub fn parameters(&self) -> &PlannerParameters {
        &self.parameters
    }

    /// The modules in ascending order of identifier; their links are symmetric.
    pub fn modules(&self) -> &[PlanningModule] {
        &self.modules
    }

    /// The position of a module in [`Self::modules`].
    pub fn position_of(&self, id: ModuleId) -> Option<usize> {
        self.modules
            .binary_search_by_key(&id, |module| module.id)
            .ok()
    }

    /// The module of that identifier.
    pub fn module(&self, id: ModuleId) -> Option<&PlanningModule> {
        self.position_of(id).map(|position| &self.modules[position])
    }

    /// The links between the modules, by their positions in [`Self::modules`].
    pub fn links(&self) -> Topology {
        let mut edges = Vec::new();
        for (position, module) in self.modules.iter().enumerate() {
            let higher = module.links.range(module.id..);
            let others = higher.filter_map(|&other| self.position_of(other));
            edges.extend(others.map(|other| (position, other)));
        }
        Topology::new(self.modules.len(), &edges)
    }

    /// The configurations of two or more modules that are free to move, in ascending order of their lowest module.
    ///
    /// Pinned modules, and those without a way to the target, take no part. The leader is the member that the members name, if they name exactly one of
    /// themselves; otherwise the member nearest the target's centre, the lowest of equals.
    pub fn configurations(&self) -> Vec<Configuration> {
        let components = self.links().components_within(|position| {
            self.modules[position].pin.is_none() && !self.is_cut_off(position)
        });
        components
            .into_iter()
            .filter(|members| members.len() > 1)
            .filter_map(|members| {
                let members = members.iter().map(|&position| &self.modules[position]);
                Some(Configuration {
                    leader: self.leader_among(members.clone())?,
                    modules: members.map(|member| member.id).collect(),
                })
            })
            .collect()
    }

    fn leader_among<'a>(
        &self,
        members: impl Iterator<Item = &'a PlanningModule> + Clone,
    ) -> Option<ModuleId> {
        let ids: BTreeSet<ModuleId> = members.clone().map(|member| member.id).collect();
        let named: BTreeSet<ModuleId> = members
            .clone()
            .filter_map(|member| member.leader)
            .filter(|leader| ids.contains(leader))
            .collect();
        if named.len() == 1 {
            return named.first().copied();
        }
        let centre = self.target.centre();
        members
            .min_by_key(|member| (member.pose.distance_to(&centre), member.id))
            .map(|member| member.id)
    }
}

/// Whether obstacles, walls and bodies leave each module no way to the target; empty if there are none of them. All spots are
/// connected by steps, so a module that reaches one reaches all.
pub(crate) fn cut_off(target: &Target, modules: &[PlanningModule], bodies: &[Area]) -> Vec<bool> {
    if target.surroundings().is_open() && bodies.is_empty() {
        return Vec::new();
    }
    let Some(cells) = FreeCells::around(target, modules, bodies) else {
        return Vec::new();
    };
    let starts = cells.starts(modules);
    let wanted: Vec<usize> = starts.iter().copied().flatten().collect();
    let (mut steps, mut queue) = (Vec::new(), Vec::new());
    cells.search(cells.spots()[0], &wanted, &mut steps, &mut queue);
    let is_cut_off = |start: Option<usize>| start.is_some_and(|cell| steps[cell] == CELL_UNREACHED);
    starts.into_iter().map(is_cut_off).collect()
}
