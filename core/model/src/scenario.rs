//! Scenario files: a target, and modules that start alone or docked into configurations.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::field_error::{check_id, checked_pose, connected_graph};
use crate::yaml::YamlError;
use crate::{
    BodyShape, ConfigurationId, FieldError, GivenRefused, LINKS_MAX, MODULES_MAX, ModuleId,
    ModuleSize, NAME_BYTES_MAX, PlannerParameters, PlanningModule, PlanningProblem, Policy,
    ProblemError, RawArea, RawGiven, RawModule, RawPlacement, RawSurroundings, RawTarget, SpotId,
    Surroundings, Target, Topology,
};

/// The greatest depth of nested brackets; scenarios nest four.
pub(crate) const NESTING_MAX: usize = 64;

/// An initial configuration as it stands in a scenario file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfiguration {
    /// The configuration's identifier.
    pub id: u32,
    /// The leading module; if left out, the member nearest the target's centre leads, the lowest of equals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leader: Option<u32>,
    /// The members.
    pub modules: Vec<RawModule>,
    /// Pairs of docked members.
    #[serde(default)]
    pub edges: Vec<[u32; 2]>,
}

fn is_square(body: &BodyShape) -> bool {
    *body == BodyShape::Square
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_false(flag: &bool) -> bool {
    !flag
}

/// A scenario file, not yet checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawScenario {
    /// The scenario's name.
    #[serde(default)]
    pub name: String,
    /// The target configuration.
    pub target: RawTarget,
    /// The initial configurations.
    #[serde(default)]
    pub configurations: Vec<RawConfiguration>,
    /// The modules that start alone.
    #[serde(default)]
    pub singletons: Vec<RawModule>,
    /// The user's choices about planning.
    #[serde(default)]
    pub planner: PlannerParameters,
    /// The metres in a unit; `None` for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub module_size: Option<f64>,
    /// The shape of a body.
    #[serde(default, skip_serializing_if = "is_square")]
    pub body: BodyShape,
    /// The width of a body, in units; `None` for [`crate::BODY_WIDTH`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_width: Option<f64>,
    /// Boxes that no module may enter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<RawArea>,
    /// The box that no module may leave; `None` for an open field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arena: Option<RawArea>,
    /// Who takes which spot, under the policy `given`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub given: Option<RawGiven>,
    /// Whether the target may be in several parts, which are planned and checked, but not docked.
    #[serde(default, skip_serializing_if = "is_false")]
    pub in_parts: bool,
}

/// A validated scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scenario {
    name: String,
    problem: PlanningProblem,
    module_size: Option<ModuleSize>,
}

/// Why a scenario was refused; each message begins with the place or the field that is wrong.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The text is no YAML of the scenario's schema; the message names the line and column.
    #[error(transparent)]
    Yaml(#[from] YamlError),
    /// Brackets are nested deeper than any scenario needs.
    #[error("line {line} column {column}: brackets are nested more than {NESTING_MAX} deep")]
    TooDeep {
        /// The line of the first bracket that is too deep, from 1.
        line: usize,
        /// Its column, from 1.
        column: usize,
    },
    /// The target, a module or a configuration is wrong.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The modules do not fit the target or each other.
    #[error("modules: {0}")]
    Problem(ProblemError),
    /// The modules cannot carry out the allocation that the target gives.
    #[error(transparent)]
    Given(#[from] GivenRefused),
}

impl From<ProblemError> for ScenarioError {
    fn from(error: ProblemError) -> Self {
        match error {
            ProblemError::Given(error) => Self::Given(error),
            error => Self::Problem(error),
        }
    }
}

impl From<serde_yaml::Error> for ScenarioError {
    fn from(error: serde_yaml::Error) -> Self {
        Self::Yaml(error.into())
    }
}

fn check_length(field: &str, name: &str) -> Result<(), FieldError> {
    let length = name.len();
    if length > NAME_BYTES_MAX {
        let reason = format!("is {length} bytes long; at most {NAME_BYTES_MAX} are supported");
        return Err(FieldError::new(field, reason));
    }
    Ok(())
}

impl PlanningProblem {
    /// The same problem for the same spots, of which it is given who takes which.
    ///
    /// # Errors
    /// Names the entry, the module or the spot that is wrong.
    pub fn with_given(&self, raw: &RawGiven) -> Result<Self, ScenarioError> {
        let target = Target::clone(self.target()).with_given(raw)?;
        let problem = self.under_given(Arc::new(target));
        problem.check_given()?;
        Ok(problem)
    }
}

/// Refuses an allocation without the policy that follows it, and the other way round.
pub(crate) fn check_given(policy: Policy, is_given: bool) -> Result<(), FieldError> {
    match (policy, is_given) {
        (Policy::Given, false) => Err(FieldError::new(
            "target.allocation",
            "is missing, and `policy: given` needs it",
        )),
        (policy, true) if policy != Policy::Given => Err(FieldError::new(
            "target.allocation",
            format_args!(
                "belongs to `policy: given`; the policy is {}",
                policy.name()
            ),
        )),
        _ => Ok(()),
    }
}

/// The target, which only the policy `given` fills in several parts: the others join the spots that they fill.
fn checked_target(raw: RawTarget, in_parts: bool, policy: Policy) -> Result<Target, FieldError> {
    if !in_parts {
        return Target::try_from(raw);
    }
    if policy != Policy::Given {
        let reason = format!(
            "belongs to `policy: given`; the policy is {}",
            policy.name()
        );
        return Err(FieldError::new("in_parts", reason));
    }
    Target::in_parts(raw)
}

/// A full turn, with room for roundings.
const HEADING_LIMIT: f64 = 6.284;

/// Refuses a heading beyond a full turn, which is probably in degrees. One that is no number is refused by its quantisation.
fn check_heading(
    field: &str,
    name: impl fmt::Display,
    placed: &RawPlacement,
) -> Result<(), FieldError> {
    if placed.theta.is_finite() && placed.theta.abs() > HEADING_LIMIT {
        let reason = format!(
            "{} is beyond a full turn of 2π; headings are in radians ({name})",
            placed.theta
        );
        return Err(FieldError::new(format_args!("{field}.theta"), reason));
    }
    Ok(())
}

/// Refuses more neighbours than a module can announce.
fn check_degrees<N: fmt::Display>(
    topology: &Topology,
    name: impl Fn(usize) -> N,
) -> Result<(), FieldError> {
    let mut degrees = (0..topology.node_count()).map(|node| (node, topology.degree(node)));
    let Some((node, degree)) = degrees.find(|&(_, degree)| degree > LINKS_MAX) else {
        return Ok(());
    };
    let name = name(node);
    let reason = format!("{name} has {degree} neighbours; at most {LINKS_MAX} are supported");
    Err(FieldError::new("edges", reason))
}

impl Scenario {
    /// The scenario's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The metres in a unit, if the scenario gives them.
    pub fn module_size(&self) -> Option<ModuleSize> {
        self.module_size
    }

    /// Refuses a target in several parts: modules dock into one formation.
    ///
    /// # Errors
    /// Says in how many parts the target is.
    pub fn check_formable(&self) -> Result<(), FieldError> {
        match self.problem.target().topology().components().len() {
            0 | 1 => Ok(()),
            parts => {
                let reason = format!(
                    "the target is in {parts} parts, and modules dock into one formation; it can be planned and checked \
                     (`formation plan`), not formed"
                );
                Err(FieldError::new("target.in_parts", reason))
            }
        }
    }

    /// The input of the plan.
    pub fn problem(&self) -> &PlanningProblem {
        &self.problem
    }
}

/// Modules with distinct identifiers.
#[derive(Default)]
struct ModuleList {
    modules: Vec<PlanningModule>,
    /// The list to which each module belongs: its configuration, or the singletons.
    owners: BTreeMap<ModuleId, String>,
}

impl ModuleList {
    /// Adds a module with the path `field` that belongs to `owner`.
    fn add(
        &mut self,
        field: &str,
        owner: &str,
        raw: RawModule,
    ) -> Result<&mut PlanningModule, FieldError> {
        let id = ModuleId(raw.id);
        check_id(format_args!("{field}.id"), raw.id)?;
        if let Some(other) = self.owners.insert(id, owner.to_owned()) {
            let reason = format!("{id} is used twice: in {other} and in {owner}");
            return Err(FieldError::new(format_args!("{field}.id"), reason));
        }
        check_heading(field, id, &raw)?;
        let pose = checked_pose(field, id, (raw.x, raw.y, raw.theta))?;
        let position = self.modules.len();
        self.modules.push(PlanningModule {
            id,
            pose,
            links: BTreeSet::new(),
            configuration: None,
            leader: None,
            pin: None,
        });
        Ok(&mut self.modules[position])
    }

    /// Adds the members of a configuration with the path `field`.
    fn add_configuration(&mut self, field: &str, raw: &RawConfiguration) -> Result<(), FieldError> {
        let owner = ConfigurationId(raw.id).to_string();
        if raw.modules.is_empty() {
            let reason = format!("{owner} has no modules");
            return Err(FieldError::new(format_args!("{field}.modules"), reason));
        }
        let first = self.modules.len();
        for (index, module) in raw.modules.iter().enumerate() {
            let added = self.add(&format!("{field}.modules[{index}]"), &owner, *module)?;
            added.configuration = Some(ConfigurationId(raw.id));
            added.leader = raw.leader.map(ModuleId);
        }
        let ids: Vec<u32> = raw.modules.iter().map(|module| module.id).collect();
        if let Some(leader) = raw.leader.filter(|leader| !ids.contains(leader)) {
            let reason = format!("{} is not in {owner}", ModuleId(leader));
            return Err(FieldError::new(format_args!("{field}.leader"), reason));
        }
        let links = connected_graph(&ids, &raw.edges, ModuleId, &owner)
            .and_then(|links| check_degrees(&links, |node| ModuleId(ids[node])).map(|()| links))
            .map_err(|error| error.within(field))?;
        for (node, module) in self.modules[first..].iter_mut().enumerate() {
            let others = links.neighbours(node).iter();
            module.links = others.map(|&other| ModuleId(ids[other])).collect();
        }
        Ok(())
    }
}

impl TryFrom<RawScenario> for Scenario {
    type Error = ScenarioError;

    fn try_from(raw: RawScenario) -> Result<Self, ScenarioError> {
        check_length("name", &raw.name)?;
        check_length("target.frame_id", &raw.target.frame_id)?;
        let in_target = |error: FieldError| error.within("target");
        let module_size = raw.module_size.map(ModuleSize::from_metres).transpose();
        let module_size = module_size.map_err(|error| FieldError::new("module_size", error))?;
        let raw_surroundings = RawSurroundings {
            body: raw.body,
            body_width: raw.body_width,
            obstacles: raw.obstacles,
            arena: raw.arena,
        };
        let surroundings = Surroundings::try_from(raw_surroundings.clone())?;
        for (index, spot) in raw.target.spots.iter().enumerate() {
            check_heading(&format!("spots[{index}]"), SpotId(spot.id), spot).map_err(in_target)?;
        }
        let target = checked_target(raw.target, raw.in_parts, raw.planner.policy);
        let target = target.map_err(in_target)?;
        if surroundings.check_spots(target.spots()).is_err() {
            raw_surroundings.check_spots(target.spots())?;
        }
        let target = target.within(surroundings)?;
        check_given(raw.planner.policy, raw.given.is_some())?;
        let target = match &raw.given {
            Some(given) => target.with_given(given).map_err(in_target)?,
            None => target,
        };
        check_degrees(target.topology(), |node| target.spots()[node].id).map_err(in_target)?;
        let members = raw.configurations.iter().map(|one| one.modules.len());
        let count = raw.singletons.len() + members.sum::<usize>();
        if count > MODULES_MAX {
            return Err(ProblemError::TooManyModules(count).into());
        }
        let mut list = ModuleList::default();
        let mut configuration_ids = BTreeSet::new();
        for (position, configuration) in raw.configurations.iter().enumerate() {
            let field = format!("configurations[{position}]");
            check_id(format_args!("{field}.id"), configuration.id)?;
            if !configuration_ids.insert(configuration.id) {
                let reason = format!("{} is used twice", ConfigurationId(configuration.id));
                return Err(FieldError::new(format_args!("{field}.id"), reason).into());
            }
            list.add_configuration(&field, configuration)?;
        }
        for (index, module) in raw.singletons.iter().enumerate() {
            list.add(&format!("singletons[{index}]"), "singletons", *module)?;
        }
        let problem = PlanningProblem::new(Arc::new(target), raw.planner, list.modules)?;
        problem.check_given()?;
        Ok(Self {
            name: raw.name,
            module_size,
            problem,
        })
    }
}
