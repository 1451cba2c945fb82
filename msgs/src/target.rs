//! What travels on `target`.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{
    self as model, BodyShape, CutPrice, ModuleSize, PaperOptions, Policy, RawArea, RawGiven,
    RawGivenSpot, RawSpot, RawSurroundings, RawTarget, Spread, Surroundings, Target,
    TargetAnnouncement, TurnOrder, Weights, WeightsError,
};
use serde::{Deserialize, Serialize};

use crate::bounds::{MODULES_MAX, OBSTACLES_MAX, POLICY_OPTIONS_MAX};
use crate::check::{self, Checked, FieldError, PROTOCOL_VERSION};
use crate::claim::SpotSelection;
use crate::error::Fault;
use crate::standard::Header;

/// See `Spot.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spot {
    pub id: u32,
    pub x: f64,
    pub y: f64,
    pub theta: f64,
}

/// See `Edge.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Edge {
    pub first: u32,
    pub second: u32,
}

/// See `Area.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Area {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

/// See `PolicyOption.msg`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PolicyOption {
    pub key: String,
    pub value: String,
}

/// See `PlannerParameters.msg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannerParameters {
    pub policy: String,
    pub order: u8,
    pub d_max: i32,
    pub exact_finish: bool,
    pub weight_loc: f64,
    pub weight_dock: f64,
    pub weight_undock: f64,
    pub cut_price: f64,
    pub spread: f64,
    pub keep_all_spots: bool,
    pub policy_options: Vec<PolicyOption>,
    pub motion: u8,
}

/// See `TargetConfiguration.msg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetConfiguration {
    pub header: Header,
    pub protocol_version: u32,
    pub session: u64,
    pub revision: u64,
    pub name: String,
    pub withdrawn: bool,
    pub expected_modules: u32,
    pub voters: Vec<u32>,
    pub spots: Vec<Spot>,
    pub edges: Vec<Edge>,
    pub planner: PlannerParameters,
    pub module_size: f64,
    pub body_width: f64,
    pub body: u8,
    pub obstacles: Vec<Area>,
    pub arena: Area,
    pub allocation: Vec<SpotSelection>,
    pub detached: Vec<u32>,
}

impl Default for TargetConfiguration {
    /// Without spots, for the version of the protocol that this library speaks.
    fn default() -> Self {
        Self {
            header: Header::default(),
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            revision: 0,
            name: String::new(),
            withdrawn: false,
            expected_modules: 0,
            voters: Vec::new(),
            spots: Vec::new(),
            edges: Vec::new(),
            planner: PlannerParameters::default(),
            module_size: ModuleSize::METRE.metres(),
            body_width: 0.0,
            body: 0,
            obstacles: Vec::new(),
            arena: Area::default(),
            allocation: Vec::new(),
            detached: Vec::new(),
        }
    }
}

impl PlannerParameters {
    pub const D_MAX_UNBOUNDED: i32 = -1;
}

enumeration! {
    PlannerParameters "order": order_to_wire, order_from_wire => TurnOrder {
        ORDER_RANK RANK 0 = Rank,
        ORDER_SIZE_FIRST SIZE_FIRST 1 = SizeFirst,
    }
}

/// Values of the deprecated field `motion`.
impl PlannerParameters {
    /// Along paths.
    pub const MOTION_AUTO: u8 = 0;
    /// Along paths.
    pub const MOTION_PATHS: u8 = 1;
    /// Refused.
    pub const MOTION_STRAIGHT: u8 = 2;
}

enumeration! {
    TargetConfiguration "body": body_to_wire, body_from_wire => BodyShape {
        BODY_SQUARE SQUARE 0 = Square,
        BODY_CIRCLE CIRCLE 1 = Circle,
    }
}

impl Default for PlannerParameters {
    fn default() -> Self {
        Self::from(&model::PlannerParameters::default())
    }
}

impl From<&model::PlannerParameters> for PlannerParameters {
    /// A `d_max` beyond the wire's range goes out as the greatest number there is, which no chain can reach.
    fn from(parameters: &model::PlannerParameters) -> Self {
        Self {
            policy: parameters.policy.name().to_owned(),
            order: order_to_wire(parameters.order),
            d_max: parameters.d_max.map_or(Self::D_MAX_UNBOUNDED, |d_max| {
                i32::try_from(d_max).unwrap_or(i32::MAX)
            }),
            exact_finish: parameters.exact_finish,
            weight_loc: parameters.weights.loc().to_units(),
            weight_dock: parameters.weights.dock().to_units(),
            weight_undock: parameters.weights.undock().to_units(),
            cut_price: parameters.cut_price.per_cut().to_units(),
            spread: parameters.spread.per_unit().to_units(),
            keep_all_spots: parameters.keep_all_spots,
            policy_options: options_to_wire(parameters),
            motion: Self::MOTION_AUTO,
        }
    }
}

/// The readings of the policy `paper`; no other policy has options.
fn options_to_wire(parameters: &model::PlannerParameters) -> Vec<PolicyOption> {
    match parameters.policy {
        Policy::Paper => {
            let named = parameters.paper.named().into_iter();
            named
                .map(|(key, value)| PolicyOption {
                    key: key.to_owned(),
                    value,
                })
                .collect()
        }
        _ => Vec::new(),
    }
}

fn options_from_wire(policy: Policy, options: &[PolicyOption]) -> Checked<PaperOptions> {
    check::count("policy_options", options.len(), POLICY_OPTIONS_MAX)?;
    let mut paper = PaperOptions::default();
    let mut keys = BTreeSet::new();
    for (index, option) in options.iter().enumerate() {
        let within = |error: FieldError| error.within_entry("policy_options", index);
        check::name("key", &option.key).map_err(within)?;
        check::name("value", &option.value).map_err(within)?;
        if policy != Policy::Paper {
            return Err(within(FieldError::new("", Fault::NoOptions(policy.name()))));
        }
        if !keys.insert(&option.key) {
            let repeated = Fault::Repeated(format!("`{}`", option.key));
            return Err(within(FieldError::new("key", repeated)));
        }
        let set = paper.set(&option.key, &option.value);
        set.map_err(|error| within(FieldError::new("", error)))?;
    }
    Ok(paper)
}

impl PlannerParameters {
    pub(crate) fn validated(&self) -> Checked<model::PlannerParameters> {
        let unset = self.policy.is_empty().then(Policy::default);
        let policy = unset
            .or_else(|| Policy::named(&self.policy))
            .ok_or_else(|| {
                let name = self.policy.clone();
                FieldError::new(
                    "policy",
                    Fault::UnknownName {
                        name,
                        known: Policy::NAMES,
                    },
                )
            })?;
        if self.motion > Self::MOTION_PATHS {
            let known = "AUTO 0 and PATHS 1, which are the same: modules move along paths only";
            return Err(FieldError::unknown("motion", self.motion, known));
        }
        Ok(model::PlannerParameters {
            policy,
            paper: options_from_wire(policy, &self.policy_options)?,
            order: order_from_wire(self.order)?,
            d_max: match u32::try_from(self.d_max) {
                Ok(d_max) => Some(d_max),
                Err(_) if self.d_max == Self::D_MAX_UNBOUNDED => None,
                Err(_) => {
                    let known = "0 and above, and UNBOUNDED -1";
                    return Err(FieldError::unknown("d_max", self.d_max, known));
                }
            },
            exact_finish: self.exact_finish,
            weights: Weights::from_units(self.weight_loc, self.weight_dock, self.weight_undock)
                .map_err(|error| match error {
                    WeightsError::Weight { name, source } => {
                        FieldError::new(format!("weight_{name}"), source)
                    }
                    WeightsError::Order { .. } => FieldError::new("", error),
                })?,
            cut_price: CutPrice::from_units(self.cut_price)
                .map_err(|error| FieldError::new("cut_price", error))?,
            spread: Spread::from_units(self.spread)
                .map_err(|error| FieldError::new("spread", error))?,
            keep_all_spots: self.keep_all_spots,
        })
    }
}

impl Area {
    fn new(area: &model::Area, size: ModuleSize) -> Self {
        let raw = area.to_raw();
        let [x, y, width, height] =
            [raw.x, raw.y, raw.width, raw.height].map(|units| size.scale_to_metres(units));
        Self {
            x,
            y,
            width,
            height,
        }
    }

    /// The area in units. Its ends are converted, as its middle may lie between two micro-units.
    fn in_units(&self, size: ModuleSize) -> RawArea {
        let along = |middle: f64, extent: f64| {
            let [low, high] =
                [middle - extent / 2.0, middle + extent / 2.0].map(|end| size.scale_to_units(end));
            (f64::midpoint(low, high), high - low)
        };
        let (x, width) = along(self.x, self.width);
        let (y, height) = along(self.y, self.height);
        RawArea {
            x,
            y,
            width,
            height,
        }
    }
}

impl TargetConfiguration {
    /// An announced target, as it goes out. The header's stamp stays zero, for the sender to fill.
    #[must_use]
    pub fn new(announcement: &TargetAnnouncement, size: ModuleSize) -> Self {
        let target = announcement.target.as_deref();
        let raw = target.map(Target::to_raw);
        let surroundings = target.map(Target::surroundings);
        let given = target.and_then(Target::given);
        let (frame_id, spots, edges) =
            raw.map_or_else(Default::default, |raw| (raw.frame_id, raw.spots, raw.edges));
        let in_metres = |RawSpot { id, x, y, theta }| Spot {
            id,
            x: size.scale_to_metres(x),
            y: size.scale_to_metres(y),
            theta,
        };
        Self {
            header: Header {
                frame_id,
                ..Header::default()
            },
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            revision: announcement.revision,
            name: announcement.name.clone(),
            withdrawn: target.is_none(),
            expected_modules: announcement.expected_modules.unwrap_or(0),
            voters: announcement.voters.iter().map(|id| id.0).collect(),
            spots: spots.into_iter().map(in_metres).collect(),
            edges: edges
                .into_iter()
                .map(|[first, second]| Edge { first, second })
                .collect(),
            planner: PlannerParameters::from(&announcement.parameters),
            module_size: size.metres(),
            body_width: surroundings.map_or(0.0, |own| size.to_metres(own.body_width())),
            body: surroundings.map_or(0, |own| body_to_wire(own.body())),
            obstacles: surroundings.map_or_else(Vec::new, |own| {
                let areas = own.obstacles().iter();
                areas.map(|area| Area::new(area, size)).collect()
            }),
            arena: surroundings
                .and_then(Surroundings::arena)
                .map_or_else(Area::default, |area| Area::new(&area, size)),
            allocation: given.map_or_else(Vec::new, |given| {
                let spots = given.spots().iter();
                spots
                    .map(|(&module, &spot)| SpotSelection::new(spot, module))
                    .collect()
            }),
            detached: given.map_or_else(Vec::new, |given| {
                given.detached().iter().map(|module| module.0).collect()
            }),
        }
    }

    pub(crate) fn validated(self, size: ModuleSize) -> Checked<TargetAnnouncement> {
        check::version(self.protocol_version)?;
        // A withdrawal has no lengths, and stops modules of any size.
        if !self.withdrawn {
            check::module_size(self.module_size, size)?;
        }
        check::name("header.frame_id", &self.header.frame_id)?;
        check::name("name", &self.name)?;
        let expected = self.expected_modules.into();
        check::at_most("expected_modules", expected, MODULES_MAX as u64)?;
        let parameters = self
            .planner
            .validated()
            .map_err(|error| error.within("planner"))?;
        let target = if self.withdrawn {
            let lists = [
                ("spots", self.spots.len()),
                ("edges", self.edges.len()),
                ("obstacles", self.obstacles.len()),
                ("allocation", self.allocation.len()),
                ("detached", self.detached.len()),
            ];
            check::empty(&lists, "must be empty while the target is withdrawn")?;
            None
        } else {
            let target = self.validated_target(size)?;
            Some(Arc::new(self.with_allocation(target, parameters.policy)?))
        };
        Ok(TargetAnnouncement {
            revision: self.revision,
            name: self.name,
            target,
            parameters,
            expected_modules: (self.expected_modules != 0).then_some(self.expected_modules),
            voters: check::module_ids("voters", &self.voters, MODULES_MAX)?,
        })
    }
}

impl TargetConfiguration {
    /// An area without extent at the origin stands for none.
    fn has_arena(&self) -> bool {
        self.arena != Area::default()
    }

    /// The target with its allocation, which comes with the policy `given` alone.
    fn with_allocation(&self, target: Target, policy: Policy) -> Checked<Target> {
        check::count("allocation", self.allocation.len(), MODULES_MAX)?;
        let is_given = policy == Policy::Given;
        if is_given == self.allocation.is_empty() || !is_given && !self.detached.is_empty() {
            let reason = "is for the policy `given`, which needs it";
            return Err(FieldError::contradiction("allocation", reason));
        }
        if !is_given {
            return Ok(target);
        }
        let entries = self.allocation.iter().map(|selection| RawGivenSpot {
            module: selection.module_id,
            spot: selection.spot_id,
        });
        let given = RawGiven {
            allocation: entries.collect(),
            detached: self.detached.clone(),
        };
        let refused = |error| FieldError::new("", error);
        target.with_given(&given).map_err(refused)
    }

    fn validated_target(&self, size: ModuleSize) -> Checked<Target> {
        check::count("obstacles", self.obstacles.len(), OBSTACLES_MAX)?;
        let in_units = |&Spot { id, x, y, theta }: &Spot| RawSpot {
            id,
            x: size.scale_to_units(x),
            y: size.scale_to_units(y),
            theta,
        };
        let edges = self.edges.iter();
        let raw = RawTarget {
            frame_id: self.header.frame_id.clone(),
            spots: self.spots.iter().map(in_units).collect(),
            edges: edges.map(|edge| [edge.first, edge.second]).collect(),
        };
        let width = size.scale_to_units(self.body_width);
        let body = body_from_wire(self.body)?;
        let surroundings = Surroundings::try_from(RawSurroundings {
            body,
            body_width: (self.body_width != 0.0).then_some(width),
            obstacles: self
                .obstacles
                .iter()
                .map(|area| area.in_units(size))
                .collect(),
            arena: self.has_arena().then(|| self.arena.in_units(size)),
        });
        let refused = |error| FieldError::new("", error);
        let target = Target::try_from(raw).map_err(refused)?;
        target
            .within(surroundings.map_err(refused)?)
            .map_err(refused)
    }
}
