//! Scenario files: a target, and modules that stand about singly or docked into configurations.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::model::{
    ConfigurationId, CutPrice, CutPriceError, LINKS_MAX, MODULES_MAX, ModuleId, NAME_BYTES_MAX,
    NO_ID, PlannerParameters, PlanningModule, PlanningProblem, Policy, Pose, PoseError,
    ProblemError, RawTarget, Target, TargetError, Topology, TopologyError, TurnOrder, Weights,
    WeightsError,
};

/// A module as it stands in a scenario file. Units and radians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawModule {
    /// The module's identifier.
    pub id: u32,
    /// Position in units.
    pub x: f64,
    /// Position in units.
    pub y: f64,
    /// Heading in radians.
    #[serde(default)]
    pub theta: f64,
}

/// An initial configuration as it stands in a scenario file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfiguration {
    /// The configuration's identifier.
    pub id: u32,
    /// The leading module; left out, the member nearest the target's centre leads, ties by identifier.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leader: Option<u32>,
    /// The members.
    pub modules: Vec<RawModule>,
    /// Pairs of docked members.
    #[serde(default)]
    pub edges: Vec<[u32; 2]>,
}

/// The weights as they stand in a scenario file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawWeights {
    /// The cost of one unit of way.
    pub loc: f64,
    /// The cost of one docking, per link end.
    pub dock: f64,
    /// The cost of one undocking, per link end.
    pub undock: f64,
}

impl Default for RawWeights {
    fn default() -> Self {
        Self::from(Weights::default())
    }
}

impl From<Weights> for RawWeights {
    fn from(weights: Weights) -> Self {
        Self {
            loc: weights.loc().to_units(),
            dock: weights.dock().to_units(),
            undock: weights.undock().to_units(),
        }
    }
}

/// The planner section as it stands in a scenario file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawPlanner {
    /// Which planner decides.
    pub policy: Policy,
    /// In which order units take their turns.
    pub order: TurnOrder,
    /// At most how many evictions one chain may make; null is unbounded.
    pub d_max: Option<u32>,
    /// With a bounded `d_max`, let the last turn restore the optimum of the singletons.
    pub exact_finish: bool,
    /// The weights of the cost of taking a spot.
    pub weights: RawWeights,
    /// What a configuration pays for each cut when it chooses its spots; 0 lets the utility decide alone.
    pub cut_price: f64,
    /// Keep every spot even when there are fewer modules than spots.
    pub keep_all_spots: bool,
}

impl Default for RawPlanner {
    fn default() -> Self {
        Self::from(PlannerParameters::default())
    }
}

/// Why a planner section was refused; each message begins with the field that is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PlannerError {
    /// The weights are wrong.
    #[error("weights: {0}")]
    Weights(#[from] WeightsError),
    /// The price of cuts is wrong.
    #[error("cut_price: {0}")]
    CutPrice(#[from] CutPriceError),
}

impl TryFrom<RawPlanner> for PlannerParameters {
    type Error = PlannerError;

    fn try_from(raw: RawPlanner) -> Result<Self, PlannerError> {
        Ok(Self {
            policy: raw.policy,
            order: raw.order,
            d_max: raw.d_max,
            exact_finish: raw.exact_finish,
            weights: Weights::from_units(raw.weights.loc, raw.weights.dock, raw.weights.undock)?,
            cut_price: CutPrice::from_units(raw.cut_price)?,
            keep_all_spots: raw.keep_all_spots,
        })
    }
}

impl From<PlannerParameters> for RawPlanner {
    fn from(parameters: PlannerParameters) -> Self {
        Self {
            policy: parameters.policy,
            order: parameters.order,
            d_max: parameters.d_max,
            exact_finish: parameters.exact_finish,
            weights: parameters.weights.into(),
            cut_price: parameters.cut_price.per_cut().to_units(),
            keep_all_spots: parameters.keep_all_spots,
        }
    }
}

/// A scenario file, not yet checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawScenario {
    /// What the scenario is called.
    #[serde(default)]
    pub name: String,
    /// The target configuration.
    pub target: RawTarget,
    /// The initial configurations.
    #[serde(default)]
    pub configurations: Vec<RawConfiguration>,
    /// The modules that stand alone.
    #[serde(default)]
    pub singletons: Vec<RawModule>,
    /// What the user chose about planning.
    #[serde(default)]
    pub planner: RawPlanner,
}

/// A validated scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scenario {
    name: String,
    problem: PlanningProblem,
}

/// Why a scenario was refused; each message begins with the field that is wrong.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The text is no YAML of the scenario's schema; the message names the line and column.
    #[error("{0}")]
    Yaml(#[from] serde_yaml::Error),
    /// Brackets are nested deeper than any scenario needs.
    #[error("line {line} column {column}: brackets are nested more than {NESTING_MAX} deep")]
    TooDeep {
        /// The line of the first bracket that is too deep, from 1.
        line: usize,
        /// Its column, from 1.
        column: usize,
    },
    /// The target is wrong.
    #[error("target.{0}")]
    Target(#[from] TargetError),
    /// The planner section is wrong.
    #[error("planner.{0}")]
    Planner(#[from] PlannerError),
    /// A module or a configuration is wrong.
    #[error("{field}: {reason}")]
    Field {
        /// The path of the field, such as `configurations[0].modules[2].id`.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The whole does not fit together.
    #[error("modules: {0}")]
    Problem(#[from] ProblemError),
}

/// A scenario nests four brackets at most.
const NESTING_MAX: usize = 64;

/// Refuses brackets nested so deep that the parser would take time in the square of their number.
///
/// Quotes are not told apart from other text: a name with more than [`NESTING_MAX`] brackets left open is refused too.
fn check_nesting(text: &str) -> Result<(), ScenarioError> {
    let mut depth = 0_usize;
    for (line, content) in text.lines().enumerate() {
        let mut previous = ' ';
        for (column, character) in content.chars().enumerate() {
            match character {
                '#' if previous.is_whitespace() => break,
                '[' | '{' => depth += 1,
                ']' | '}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth > NESTING_MAX {
                return Err(ScenarioError::TooDeep {
                    line: line + 1,
                    column: column + 1,
                });
            }
            previous = character;
        }
    }
    Ok(())
}

fn check_length(field: &str, name: &str) -> Result<(), ScenarioError> {
    if name.len() > NAME_BYTES_MAX {
        return Err(field_error(
            field,
            format!(
                "is {} bytes long, at most {NAME_BYTES_MAX} are supported",
                name.len()
            ),
        ));
    }
    Ok(())
}

/// Refuses more neighbours than a module can announce.
fn check_degrees<T: fmt::Display>(
    field: &str,
    topology: &Topology,
    name: impl Fn(usize) -> T,
) -> Result<(), ScenarioError> {
    let crowded = (0..topology.node_count()).find(|&node| topology.degree(node) > LINKS_MAX);
    match crowded {
        None => Ok(()),
        Some(node) => Err(field_error(
            field,
            format!(
                "{} has {} neighbours, at most {LINKS_MAX} are supported",
                name(node),
                topology.degree(node)
            ),
        )),
    }
}

fn field_error(field: impl Into<String>, reason: impl Into<String>) -> ScenarioError {
    ScenarioError::Field {
        field: field.into(),
        reason: reason.into(),
    }
}

impl Scenario {
    /// Reads and validates the text of a scenario file.
    ///
    /// # Errors
    /// Names the line of a syntax error, or the field that is wrong and why.
    pub fn from_yaml(text: &str) -> Result<Self, ScenarioError> {
        check_nesting(text)?;
        Self::try_from(serde_yaml::from_str::<RawScenario>(text)?)
    }

    /// What the scenario is called.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The input of the plan.
    #[must_use]
    pub fn problem(&self) -> &PlanningProblem {
        &self.problem
    }
}

/// Collects modules while it checks that no identifier is used twice.
#[derive(Default)]
struct ModuleList {
    modules: Vec<PlanningModule>,
    first_seen: BTreeMap<ModuleId, String>,
}

impl ModuleList {
    fn add(
        &mut self,
        field: &str,
        owner: &str,
        raw: RawModule,
    ) -> Result<&mut PlanningModule, ScenarioError> {
        let id = ModuleId(raw.id);
        if raw.id == NO_ID {
            return Err(field_error(
                format!("{field}.id"),
                format!("{NO_ID} is reserved and cannot be used"),
            ));
        }
        if let Some(other) = self.first_seen.insert(id, owner.to_owned()) {
            return Err(field_error(
                format!("{field}.id"),
                format!("{id} is used twice: in {other} and in {owner}"),
            ));
        }
        let pose = Pose::from_units(raw.x, raw.y, raw.theta).map_err(
            |PoseError { coordinate, source }| {
                field_error(format!("{field}.{coordinate}"), format!("{source} ({id})"))
            },
        )?;
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
}

fn add_configuration(
    list: &mut ModuleList,
    position: usize,
    raw: &RawConfiguration,
) -> Result<(), ScenarioError> {
    let field = format!("configurations[{position}]");
    let owner = ConfigurationId(raw.id).to_string();
    if raw.modules.is_empty() {
        return Err(field_error(
            format!("{field}.modules"),
            format!("{owner} has no modules"),
        ));
    }
    let first = list.modules.len();
    for (index, module) in raw.modules.iter().enumerate() {
        let added = list.add(&format!("{field}.modules[{index}]"), &owner, *module)?;
        added.configuration = Some(ConfigurationId(raw.id));
        added.leader = raw.leader.map(ModuleId);
    }
    let member = |id: u32| raw.modules.iter().position(|module| module.id == id);
    if let Some(leader) = raw.leader
        && member(leader).is_none()
    {
        return Err(field_error(
            format!("{field}.leader"),
            format!("{} is no member of {owner}", ModuleId(leader)),
        ));
    }
    let mut edges = Vec::with_capacity(raw.edges.len());
    for (index, &[one, other]) in raw.edges.iter().enumerate() {
        let at = |id: u32| {
            member(id).ok_or_else(|| {
                field_error(
                    format!("{field}.edges[{index}]"),
                    format!("{} is no member of {owner}", ModuleId(id)),
                )
            })
        };
        let edge = (at(one)?, at(other)?);
        edges.push(edge);
        let modules = &mut list.modules[first..];
        modules[edge.0].links.insert(ModuleId(other));
        modules[edge.1].links.insert(ModuleId(one));
    }
    let name = |node: usize| ModuleId(raw.modules[node].id);
    let topology = Topology::new(raw.modules.len(), &edges).map_err(|error| {
        let reason = match error {
            TopologyError::SelfLoop(node) => format!("joins {} to itself", name(node)),
            TopologyError::Duplicate(one, other) => {
                format!("{} and {} are joined twice", name(one), name(other))
            }
            TopologyError::NoSuchNode(..) => error.to_string(),
        };
        field_error(format!("{field}.edges"), reason)
    })?;
    check_degrees(&format!("{field}.edges"), &topology, name)?;
    let components = topology.components_within(|_| true);
    if let Some(apart) = components.get(1) {
        return Err(field_error(
            format!("{field}.edges"),
            format!(
                "{owner} is disconnected; {} cannot be reached from {}",
                name(apart[0]),
                name(0)
            ),
        ));
    }
    Ok(())
}

impl TryFrom<RawScenario> for Scenario {
    type Error = ScenarioError;

    fn try_from(raw: RawScenario) -> Result<Self, ScenarioError> {
        check_length("name", &raw.name)?;
        check_length("target.frame_id", &raw.target.frame_id)?;
        let target = Target::try_from(raw.target)?;
        check_degrees("target.edges", target.topology(), |node| {
            target.spots()[node].id
        })?;
        let parameters = PlannerParameters::try_from(raw.planner)?;
        let count = raw.singletons.len()
            + raw
                .configurations
                .iter()
                .map(|configuration| configuration.modules.len())
                .sum::<usize>();
        if count > MODULES_MAX {
            return Err(ProblemError::TooManyModules(count).into());
        }
        let mut list = ModuleList::default();
        let mut configuration_ids = BTreeSet::new();
        for (position, configuration) in raw.configurations.iter().enumerate() {
            if configuration.id == NO_ID || !configuration_ids.insert(configuration.id) {
                return Err(field_error(
                    format!("configurations[{position}].id"),
                    format!(
                        "{} is used twice or reserved",
                        ConfigurationId(configuration.id)
                    ),
                ));
            }
            add_configuration(&mut list, position, configuration)?;
        }
        for (index, module) in raw.singletons.iter().enumerate() {
            list.add(&format!("singletons[{index}]"), "singletons", *module)?;
        }
        Ok(Self {
            name: raw.name,
            problem: PlanningProblem::new(Arc::new(target), parameters, list.modules)?,
        })
    }
}
