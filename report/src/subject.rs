//! What a picture shows: modules from where they start to where they end, spots, and the links between modules.

use std::collections::{BTreeMap, BTreeSet};

use formation::model::{ConfigurationId, ModuleId, PlanningProblem, Pose, SpotId};
use formation::planner::PlanOutcome;

/// A formation from its start to its end. Modules, spots and configurations are named by their positions in the lists.
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
    /// The spot that it takes.
    pub(crate) spot: Option<usize>,
    /// Its place in the order of filling, from 1.
    pub(crate) order: Option<usize>,
    /// The module that names its acting unit, if it moves with others.
    pub(crate) moves_with: Option<ModuleId>,
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

/// Where a module was last seen.
#[derive(Clone, Debug)]
pub struct Ending {
    /// Where it stands.
    pub pose: Pose,
    /// The spot on which it has settled.
    pub spot: Option<SpotId>,
    /// The modules that it is docked to.
    pub links: BTreeSet<ModuleId>,
}

impl Subject {
    /// A formation as it is planned.
    #[must_use]
    pub fn planned(name: &str, problem: &PlanningProblem, outcome: &PlanOutcome) -> Self {
        let plan = &outcome.plan;
        let spots: BTreeMap<ModuleId, SpotId> = plan.assignments.clone();
        let holders: BTreeMap<SpotId, ModuleId> = spots
            .iter()
            .map(|(&module, &spot)| (spot, module))
            .collect();
        let endings = problem.modules().iter().map(|module| {
            let spot = spots.get(&module.id).copied();
            let standing = spot.and_then(|spot| problem.target().spot(spot));
            let beside = spot
                .into_iter()
                .flat_map(|spot| problem.target().neighbours_of(spot))
                .filter_map(|spot| holders.get(&spot).copied());
            let kept = module.links.iter().copied().filter(|&other| {
                plan.kept_links
                    .contains(&(module.id.min(other), module.id.max(other)))
            });
            let ending = Ending {
                pose: standing.map_or(module.pose, |spot| spot.pose),
                spot,
                links: beside.chain(kept).collect(),
            };
            (module.id, ending)
        });
        Self::seen(name, problem, outcome, &endings.collect())
    }

    /// A formation as it was seen to end; modules that were never seen stay where they start.
    #[must_use]
    pub fn seen(
        name: &str,
        problem: &PlanningProblem,
        outcome: &PlanOutcome,
        endings: &BTreeMap<ModuleId, Ending>,
    ) -> Self {
        let plan = &outcome.plan;
        let groups = problem.configurations();
        let configuration_of: BTreeMap<ModuleId, usize> = groups
            .iter()
            .enumerate()
            .flat_map(|(position, group)| {
                group.modules.iter().map(move |&module| (module, position))
            })
            .collect();
        let leaders: BTreeSet<ModuleId> = groups.iter().map(|group| group.leader).collect();
        let order: BTreeMap<SpotId, usize> = plan.assembly.spots().zip(1..).collect();
        let units: BTreeMap<ModuleId, ModuleId> = plan
            .assembly
            .units
            .iter()
            .filter(|unit| unit.placements.len() > 1)
            .flat_map(|unit| {
                unit.placements
                    .iter()
                    .map(|&(module, _)| (module, unit.lead))
            })
            .collect();
        let target = problem.target();
        let modules: Vec<Module> = problem
            .modules()
            .iter()
            .map(|module| {
                let ending = endings.get(&module.id);
                let spot = ending.and_then(|ending| ending.spot);
                let is_as_planned = spot == plan.assignments.get(&module.id).copied();
                Module {
                    id: module.id,
                    configuration: configuration_of.get(&module.id).copied(),
                    leads: leaders.contains(&module.id),
                    start: module.pose,
                    end: ending.map_or(module.pose, |ending| ending.pose),
                    spot: spot.and_then(|spot| target.position_of(spot)),
                    order: spot
                        .filter(|_| is_as_planned)
                        .and_then(|spot| order.get(&spot).copied()),
                    moves_with: units.get(&module.id).copied().filter(|_| is_as_planned),
                }
            })
            .collect();
        let mut spots: Vec<Spot> = target
            .spots()
            .iter()
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
        let initial = pairs(problem, |module| {
            problem.module(module).map(|module| &module.links)
        });
        let last = pairs(problem, |module| {
            endings.get(&module).map(|ending| &ending.links)
        });
        let is_kept = |ends: (usize, usize)| {
            let ids = (modules[ends.0].id, modules[ends.1].id);
            last.contains(&ends) && plan.kept_links.contains(&ids)
        };
        let links: Vec<Link> = initial
            .iter()
            .map(|&ends| Link {
                ends,
                kept: is_kept(ends),
            })
            .collect();
        Self {
            name: name.to_owned(),
            configurations: groups
                .iter()
                .map(|group| Configuration {
                    label: label(problem, group.leader),
                    size: group.modules.len(),
                })
                .collect(),
            new_links: last
                .iter()
                .copied()
                .filter(|&ends| !(initial.contains(&ends) && is_kept(ends)))
                .collect(),
            modules,
            spots,
            edges: target.topology().edges().to_vec(),
            links,
        }
    }

    pub(crate) fn position_of(&self, module: ModuleId) -> Option<usize> {
        self.modules
            .binary_search_by_key(&module, |module| module.id)
            .ok()
    }

    /// What the formation is called, for people.
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
