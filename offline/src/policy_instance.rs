//! The instance that a policy outside the planner decides on: a program or a function of Python. docs/own_policy.md describes it.

use formation_model::{Area, PlanningProblem, RawArea, Target, Weights};
use formation_planner::Utilities;
use serde::Serialize;

/// The version of the format; it rises when a key changes its meaning.
const FORMAT: u32 = 1;

/// The instance. Lengths are in units, headings in radians.
#[derive(Debug, Serialize)]
pub struct PolicyInstance {
    format: u32,
    modules: Vec<InstanceModule>,
    spots: Vec<InstanceSpot>,
    /// Pairs of adjacent spots.
    edges: Vec<[u32; 2]>,
    weights: Weights,
    keep_all_spots: bool,
    body_width: f64,
    obstacles: Vec<RawArea>,
    arena: Option<RawArea>,
}

#[derive(Debug, Serialize)]
struct InstanceModule {
    id: u32,
    x: f64,
    y: f64,
    theta: f64,
    configuration: Option<u32>,
    leader: Option<u32>,
    /// The modules to which it is docked.
    links: Vec<u32>,
    /// The spot on which it has settled, and which it keeps.
    pin: Option<u32>,
    /// Whether a way leads to the target; otherwise it gets no spot.
    reachable: bool,
}

#[derive(Debug, Serialize)]
struct InstanceSpot {
    id: u32,
    x: f64,
    y: f64,
    theta: f64,
    /// The spot's betweenness, which utilities contain.
    value: f64,
}

impl PolicyInstance {
    /// The instance of a problem.
    #[must_use]
    pub fn of(problem: &PlanningProblem) -> Self {
        let target: &Target = problem.target();
        let utilities = Utilities::of_problem(problem);
        let modules = problem.modules().iter().enumerate();
        let spots = target.spots().iter().enumerate();
        let surroundings = target.surroundings();
        Self {
            format: FORMAT,
            modules: modules
                .map(|(position, module)| InstanceModule {
                    id: module.id.0,
                    x: module.pose.x.to_units(),
                    y: module.pose.y.to_units(),
                    theta: module.pose.theta.to_units(),
                    configuration: module.configuration.map(|id| id.0),
                    leader: module.leader.map(|id| id.0),
                    links: module.links.iter().map(|id| id.0).collect(),
                    pin: module.pin.map(|id| id.0),
                    reachable: !problem.is_cut_off(position),
                })
                .collect(),
            spots: spots
                .map(|(position, spot)| InstanceSpot {
                    id: spot.id.0,
                    x: spot.pose.x.to_units(),
                    y: spot.pose.y.to_units(),
                    theta: spot.pose.theta.to_units(),
                    value: utilities.value(position).to_units(),
                })
                .collect(),
            edges: target.to_raw().edges,
            weights: problem.parameters().weights,
            keep_all_spots: problem.parameters().keep_all_spots,
            body_width: surroundings.body_width().to_units(),
            obstacles: surroundings.obstacles().iter().map(Area::to_raw).collect(),
            arena: surroundings.arena().map(|area| area.to_raw()),
        }
    }
}
