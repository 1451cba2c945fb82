//! The content of a picture: modules with their starts and ends, spots, and the links between modules.

use std::collections::{BTreeMap, BTreeSet};

use formation_event_log::{Entry, LogEvent, Scene};
use formation_model::{
    self as model, ConfigurationId, Digest, MicroUnits, ModuleId, ModulePhase, PlanningModule,
    PlanningProblem, Pose, SpotId, Surroundings,
};
use formation_motion::PlannedMotion;
use formation_planner::PlanOutcome;

/// A formation from its start to its end. Indices of modules, spots and configurations are positions in these lists.
#[derive(Clone, Debug)]
pub struct Subject {
    pub(crate) name: String,
    pub(crate) configurations: Vec<Configuration>,
    pub(crate) modules: Vec<Module>,
    pub(crate) spots: Vec<Spot>,
    /// The pairs of spots that are docked in the target.
    pub(crate) edges: Vec<(usize, usize)>,
    /// The links at the start.
    pub(crate) links: Vec<Link>,
    /// The links at the end that are not kept from the start.
    pub(crate) new_links: Vec<(usize, usize)>,
    /// Obstacles and walls.
    pub(crate) surroundings: Surroundings,
    /// The problem that the plan solves.
    pub(crate) problem: Digest,
}

/// Modules that are docked to each other at the start.
#[derive(Clone, Debug)]
pub(crate) struct Configuration {
    pub(crate) label: String,
    pub(crate) size: usize,
}

#[derive(Clone, Debug)]
pub(crate) struct Module {
    pub(crate) id: ModuleId,
    pub(crate) configuration: Option<usize>,
    /// Whether it leads its configuration.
    pub(crate) leads: bool,
    pub(crate) start: Pose,
    pub(crate) end: Pose,
    /// The spot on which it ends.
    pub(crate) spot: Option<usize>,
    /// The place of its spot in the assembly order, from 1.
    pub(crate) order: Option<usize>,
    /// The lead of its acting unit, if the unit has several modules.
    pub(crate) moves_with: Option<ModuleId>,
    /// Whether its process died.
    pub(crate) is_dead: bool,
    /// The corners of its planned path, from its start to its spot; empty if it has none.
    pub(crate) path: Vec<Pose>,
}

#[derive(Clone, Debug)]
pub(crate) struct Spot {
    pub(crate) id: SpotId,
    pub(crate) pose: Pose,
    pub(crate) holder: Option<usize>,
}

/// A link at the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub(crate) ends: (usize, usize),
    pub(crate) kept: bool,
}

/// The last state of a module.
struct Ending {
    pose: Pose,
    /// The spot on which it has settled.
    spot: Option<SpotId>,
    /// The modules that it is docked to.
    links: BTreeSet<ModuleId>,
}

impl Subject {
    /// A formation as a course of events ends, with the spots on which a verdict found its modules, if there is one. Modules of
    /// which the course shows nothing stay where they start.
    #[must_use]
    pub fn of_course(
        name: &str,
        problem: &PlanningProblem,
        outcome: &PlanOutcome,
        course: &[Entry],
        judged: Option<&BTreeMap<ModuleId, SpotId>>,
    ) -> Self {
        let endings = &endings(course, judged);
        let modules = modules(problem, outcome, endings);
        let initial = pairs(problem, |module| {
            problem.module(module).map(|module| &module.links)
        });
        let last = pairs(problem, |module| {
            endings.get(&module).map(|ending| &ending.links)
        });
        let undocked = undocked(problem, course);
        let is_kept = |ends: (usize, usize)| last.contains(&ends) && !undocked.contains(&ends);
        let link = |&ends: &(usize, usize)| Link {
            ends,
            kept: is_kept(ends),
        };
        let is_new = |ends: &(usize, usize)| !(initial.contains(ends) && is_kept(*ends));
        let configuration = |group: &model::Configuration| Configuration {
            label: label(problem, group.leader),
            size: group.modules.len(),
        };
        Self {
            name: name.to_owned(),
            configurations: problem.configurations().iter().map(configuration).collect(),
            links: initial.iter().map(link).collect(),
            new_links: last.iter().copied().filter(is_new).collect(),
            spots: spots(problem, &modules),
            edges: problem.target().topology().edges().to_vec(),
            surroundings: problem.target().surroundings().clone(),
            problem: problem.digest(),
            modules,
        }
    }

    /// Adds the paths that the plan gives the modules.
    #[must_use]
    pub fn with_paths(mut self, motion: &PlannedMotion) -> Self {
        match motion {
            PlannedMotion::Paths(motion) => {
                for unit in &motion.units {
                    for module in &unit.modules {
                        if let Some(position) = self.position_of(module.module) {
                            self.modules[position].path = unit.poses_after(0, module).collect();
                        }
                    }
                }
            }
            PlannedMotion::Refused(_) => {}
        }
        self
    }

    /// Marks the modules whose processes died.
    #[must_use]
    pub fn with_dead(mut self, dead: &BTreeSet<ModuleId>) -> Self {
        for module in &mut self.modules {
            module.is_dead = dead.contains(&module.id);
        }
        self
    }

    pub(crate) fn position_of(&self, module: ModuleId) -> Option<usize> {
        self.modules
            .binary_search_by_key(&module, |module| module.id)
            .ok()
    }

    /// The corners of obstacles and walls, which pictures show in full.
    pub(crate) fn corners(&self) -> impl Iterator<Item = Pose> {
        let (obstacles, arena) = (self.surroundings.obstacles(), self.surroundings.arena());
        obstacles.iter().copied().chain(arena).flat_map(|area| {
            let theta = MicroUnits::ZERO;
            [area.low, area.high].map(|(x, y)| Pose { x, y, theta })
        })
    }

    /// The title of pictures and pages.
    pub(crate) fn title(&self) -> &str {
        if self.name.trim().is_empty() {
            "Formation"
        } else {
            &self.name
        }
    }

    pub(crate) fn kept_links(&self) -> usize {
        self.links.iter().filter(|link| link.kept).count()
    }

    pub(crate) fn filled_spots(&self) -> usize {
        self.spots
            .iter()
            .filter(|spot| spot.holder.is_some())
            .count()
    }
}

/// The pairs of modules that were docked at the start and once were not, by position, the lower first.
fn undocked(problem: &PlanningProblem, course: &[Entry]) -> BTreeSet<(usize, usize)> {
    let states = course.iter().filter_map(|entry| match &entry.event {
        LogEvent::State(state) => Some((problem.position_of(state.module)?, state)),
        _ => None,
    });
    let broken = states.flat_map(|(position, state)| {
        let links = &problem.modules()[position].links;
        let broken = links.iter().filter(|link| !state.links.contains(link));
        let broken = broken.filter_map(|&link| problem.position_of(link));
        broken.map(move |other| (position.min(other), position.max(other)))
    });
    broken.collect()
}

/// The last state of each module in a course, with the spot that the verdict gives it, if there is one.
fn endings(
    course: &[Entry],
    judged: Option<&BTreeMap<ModuleId, SpotId>>,
) -> BTreeMap<ModuleId, Ending> {
    let mut scene = Scene::default();
    for entry in course {
        scene.apply(entry);
    }
    let endings = scene.modules().iter().map(|(&module, known)| {
        let last = &known.snapshot;
        let ending = Ending {
            pose: last.pose,
            spot: match judged {
                Some(judged) => judged.get(&module).copied(),
                None => last.spot.filter(|_| last.phase == ModulePhase::Settled),
            },
            links: last.links.clone(),
        };
        (module, ending)
    });
    endings.collect()
}

fn modules(
    problem: &PlanningProblem,
    outcome: &PlanOutcome,
    endings: &BTreeMap<ModuleId, Ending>,
) -> Vec<Module> {
    let (plan, groups) = (&outcome.plan, problem.configurations());
    let order: BTreeMap<SpotId, usize> = plan.assembly.spots().zip(1..).collect();
    let units = plan.assembly.unit_of_each();
    let module = |module: &PlanningModule| {
        let ending = endings.get(&module.id);
        let spot = ending.and_then(|ending| ending.spot);
        let is_as_planned = spot == plan.assignments.get(&module.id).copied();
        let planned_spot = spot.filter(|_| is_as_planned);
        let unit = units.get(&module.id);
        let unit = unit.filter(|unit| unit.placements.len() > 1 && is_as_planned);
        Module {
            id: module.id,
            configuration: groups
                .iter()
                .position(|group| group.modules.binary_search(&module.id).is_ok()),
            leads: groups.iter().any(|group| group.leader == module.id),
            start: module.pose,
            end: ending.map_or(module.pose, |ending| ending.pose),
            spot: spot.and_then(|spot| problem.target().position_of(spot)),
            order: planned_spot.and_then(|spot| order.get(&spot).copied()),
            moves_with: unit.map(|unit| unit.lead),
            is_dead: false,
            path: Vec::new(),
        }
    };
    problem.modules().iter().map(module).collect()
}

fn spots(problem: &PlanningProblem, modules: &[Module]) -> Vec<Spot> {
    let spots = problem.target().spots().iter();
    let mut spots: Vec<Spot> = spots
        .map(|spot| Spot {
            id: spot.id,
            pose: spot.pose,
            holder: None,
        })
        .collect();
    for (position, module) in modules.iter().enumerate() {
        if let Some(spot) = module.spot {
            spots[spot].holder = Some(position);
        }
    }
    spots
}

/// The pairs of modules that name each other, by position, the lower first.
fn pairs<'a>(
    problem: &PlanningProblem,
    links: impl Fn(ModuleId) -> Option<&'a BTreeSet<ModuleId>>,
) -> BTreeSet<(usize, usize)> {
    let mut pairs = BTreeSet::new();
    for (position, module) in problem.modules().iter().enumerate() {
        for &other in links(module.id).into_iter().flatten() {
            let is_mutual = links(other).is_some_and(|links| links.contains(&module.id));
            if let Some(other) = problem.position_of(other).filter(|_| is_mutual) {
                pairs.insert((position.min(other), position.max(other)));
            }
        }
    }
    pairs.retain(|(one, other)| one != other);
    pairs
}

fn label(problem: &PlanningProblem, leader: ModuleId) -> String {
    let named = problem
        .module(leader)
        .and_then(|module| module.configuration);
    match named {
        Some(ConfigurationId(id)) => format!("configuration {id}"),
        None => format!("configuration of {leader}"),
    }
}
