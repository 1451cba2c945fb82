//! What a goal asks for: the target that it has, or that of a scenario which it names.

use std::path::PathBuf;

use formation_model::{FreeCells, MODULES_MAX, ModuleSize, TargetAnnouncement};
use formation_msgs::{FormConfigurationGoal, IntoCore};
use formation_node_support::scenario::read_scenario;
use formation_planner::PlanSize;

/// How many scenarios the answer to a client lists that asked for one that does not exist.
const LISTED_MAX: usize = 10;

/// Finds the target of a goal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct GoalResolver {
    /// The folder of the scenarios that goals can name.
    pub folder: Option<PathBuf>,
    /// How many modules take part, where a goal does not say.
    pub expected_modules: Option<u32>,
    /// The size of the modules that form the target.
    pub module_size: ModuleSize,
}

impl GoalResolver {
    /// The announcement for a goal, without its revision; or why there can be none.
    pub(crate) fn resolve(
        &self,
        goal: FormConfigurationGoal,
    ) -> Result<TargetAnnouncement, String> {
        let expected = goal.expected_modules;
        if usize::try_from(expected).is_ok_and(|count| count > MODULES_MAX) {
            return Err(format!(
                "expected_modules: must be at most {MODULES_MAX}, got {expected}"
            ));
        }
        let announcement = if goal.scenario.is_empty() {
            let target = goal.target.into_core(self.module_size);
            target.map_err(|error| error.to_string())?
        } else {
            self.of_scenario(&goal.scenario)?
        };
        if announcement.target.is_none() {
            return Err(
                "target: withdrawn: a goal names what to form; cancel it, or call withdraw_target"
                    .to_owned(),
            );
        }
        let announcement = TargetAnnouncement {
            expected_modules: (expected > 0)
                .then_some(expected)
                .or(announcement.expected_modules)
                .or(self.expected_modules),
            ..announcement
        };
        refuse_long_plans(&announcement)?;
        Ok(announcement)
    }

    fn of_scenario(&self, name: &str) -> Result<TargetAnnouncement, String> {
        let Some(folder) = &self.folder else {
            return Err(
                "scenario: this publisher has no folder of scenarios; start it with --scenario-folder or --scenario"
                    .to_owned(),
            );
        };
        // A goal comes from outside, and must not name other files.
        let is_allowed =
            |character: char| character.is_ascii_alphanumeric() || "_-.".contains(character);
        if !name.chars().all(is_allowed) || name.starts_with('.') {
            return Err(format!(
                "scenario: `{name}` is not a name; it may have letters, digits, `_`, `-` and `.` only, and names a file \
                 of the publisher's scenario folder without its `.yaml`"
            ));
        }
        let path = folder.join(format!("{name}.yaml"));
        if !path.is_file() {
            return Err(format!(
                "scenario: there is no `{name}` in the publisher's scenario folder; there {}",
                self.listed()
            ));
        }
        let scenario = read_scenario(&path).map_err(|failure| format!("scenario: {failure}"))?;
        let (own, given) = (self.module_size, scenario.module_size());
        if let Some(given) = given.filter(|&given| given != own) {
            return Err(format!(
                "scenario: the modules of `{name}` measure {given}, and those of this publisher {own}; start it with \
                 the parameter module_size"
            ));
        }
        Ok(TargetAnnouncement {
            name: scenario.name().to_owned(),
            ..TargetAnnouncement::new(scenario.problem(), 0)
        })
    }

    /// The scenarios that there are.
    fn listed(&self) -> String {
        let folder = self.folder.iter();
        let entries = folder.filter_map(|folder| folder.read_dir().ok()).flatten();
        let mut names: Vec<String> = entries
            .filter_map(|entry| {
                let name = entry.ok()?.file_name().into_string().ok()?;
                Some(name.strip_suffix(".yaml")?.to_owned())
            })
            .collect();
        names.sort();
        let more = names.len().saturating_sub(LISTED_MAX);
        names.truncate(LISTED_MAX);
        match (names.len(), more) {
            (0, _) => "is none".to_owned(),
            (_, 0) => format!("are {}", names.join(", ")),
            (_, more) => format!("are {} and {more} more", names.join(", ")),
        }
    }
}

/// Refuses a target whose plan would take the modules too long; says why.
pub(crate) fn refuse_long_plans(announcement: &TargetAnnouncement) -> Result<(), String> {
    let Some(target) = &announcement.target else {
        return Ok(());
    };
    let modules = announcement.expected_modules.unwrap_or(0) as usize;
    let size = PlanSize {
        target,
        parameters: &announcement.parameters,
        modules,
        // How the modules are docked is not known, and single ones take longer, except on large targets with cycles.
        configured: 0,
        // Nor is where they stand.
        cells: FreeCells::around(target, &[], &[]).map_or(0, |cells| cells.count()),
    };
    size.check().map_err(|refused| refused.to_string())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use formation_model::{PlannerParameters, RawSpot, RawTarget};
    use formation_msgs::{Edge, Spot, TargetConfiguration};

    use super::*;

    fn shipped() -> GoalResolver {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .unwrap();
        GoalResolver {
            folder: Some(root.join("launch_scripts/scenarios")),
            expected_modules: Some(7),
            module_size: ModuleSize::METRE,
        }
    }

    fn named(scenario: &str) -> FormConfigurationGoal {
        FormConfigurationGoal {
            scenario: scenario.to_owned(),
            ..FormConfigurationGoal::default()
        }
    }

    #[test]
    fn a_scenario_is_found_by_its_name_and_no_other_file_is() {
        let announcement = shipped().resolve(named("singletons_10")).unwrap();
        assert_eq!(announcement.name, "singletons-10");
        assert_eq!(announcement.expected_modules, Some(7));
        for (name, expected) in [
            ("singletons", "figure1_ladder17"),
            ("../scenarios/singletons_10", "is not a name"),
            ("/etc/passwd", "is not a name"),
            (".", "is not a name"),
        ] {
            let reason = shipped().resolve(named(name)).unwrap_err();
            assert!(reason.contains(expected), "{reason}");
        }
        let reason = GoalResolver::default().resolve(named("singletons_10"));
        assert!(reason.unwrap_err().contains("--scenario-folder"));
    }

    #[test]
    fn a_target_that_would_be_planned_for_minutes_is_refused() {
        let spots = 5_000;
        let raw = RawTarget {
            frame_id: "map".to_owned(),
            spots: (0..spots)
                .map(|id| RawSpot {
                    id,
                    x: f64::from(id),
                    y: 0.0,
                    theta: 0.0,
                })
                .collect(),
            edges: (1..spots).map(|id| [id - 1, id]).collect(),
        };
        let mut announcement = TargetAnnouncement {
            revision: 1,
            name: String::new(),
            target: Some(Arc::new(raw.try_into().unwrap())),
            parameters: PlannerParameters::default(),
            expected_modules: Some(1_000),
            voters: Vec::new(),
        };
        assert_eq!(refuse_long_plans(&announcement), Ok(()));
        announcement.expected_modules = Some(spots);
        let reason = refuse_long_plans(&announcement).unwrap_err();
        assert!(
            reason.starts_with("modules: a plan for 5000 modules and 5000 spots may take 93 s"),
            "{reason}"
        );
        announcement.target = None;
        assert_eq!(refuse_long_plans(&announcement), Ok(()));
    }

    #[test]
    fn a_target_is_taken_as_it_is_given_and_must_be_one() {
        let spot = |id, x| Spot {
            id,
            x,
            ..Spot::default()
        };
        let mut goal = FormConfigurationGoal {
            target: TargetConfiguration {
                name: "pair".to_owned(),
                spots: vec![spot(1, 0.0), spot(2, 1.0)],
                edges: vec![Edge {
                    first: 1,
                    second: 2,
                }],
                ..TargetConfiguration::default()
            },
            expected_modules: 3,
            ..FormConfigurationGoal::default()
        };
        let resolver = GoalResolver::default();
        let announcement = resolver.resolve(goal.clone()).unwrap();
        assert_eq!(announcement.target.unwrap().spots().len(), 2);
        assert_eq!(announcement.expected_modules, Some(3));
        goal.target.edges.clear();
        assert!(
            resolver
                .resolve(goal.clone())
                .unwrap_err()
                .starts_with("target: ")
        );
        goal.expected_modules = 10_001;
        assert!(
            resolver
                .resolve(goal.clone())
                .unwrap_err()
                .contains("at most 10000")
        );
        goal.expected_modules = 0;
        goal.target = TargetConfiguration {
            withdrawn: true,
            ..TargetConfiguration::default()
        };
        assert!(resolver.resolve(goal).unwrap_err().contains("withdrawn"));
    }
}
