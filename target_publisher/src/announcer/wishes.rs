//! What a goal wants: a target that it holds, or that of a scenario which it names.

use std::path::PathBuf;
use std::sync::Arc;

use formation::model::{MODULES_MAX, TargetAnnouncement};
use formation_msgs::FormConfigurationGoal;

use formation_node::scenario::read_scenario;
use ros_runtime::outcome::Failure;

/// How many scenarios are named to somebody who asked for one that does not exist.
const NAMED_MAX: usize = 10;

/// Where goals find what they do not hold themselves.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Wishes {
    /// The folder of the scenarios that goals can name.
    pub(super) folder: Option<PathBuf>,
    /// How many modules take part, where a goal does not say.
    pub(super) expected_modules: Option<u32>,
}

impl Wishes {
    /// What to announce for a goal, its revision aside; or why that cannot be.
    pub(super) fn resolve(
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
            let announcement =
                TargetAnnouncement::try_from(goal.target).map_err(|error| error.to_string())?;
            if announcement.target.is_none() {
                return Err(
                    "target: withdrawn: a goal says what to form; cancel it, or call withdraw_target".to_owned(),
                );
            }
            announcement
        } else {
            self.of_scenario(&goal.scenario)?
        };
        Ok(TargetAnnouncement {
            expected_modules: (expected > 0)
                .then_some(expected)
                .or(announcement.expected_modules)
                .or(self.expected_modules),
            ..announcement
        })
    }

    fn of_scenario(&self, name: &str) -> Result<TargetAnnouncement, String> {
        let Some(folder) = &self.folder else {
            return Err(
                "scenario: this publisher knows none by name; start it with --scenario-folder or --scenario".to_owned(),
            );
        };
        // A goal comes from outside, and must not reach for other files.
        let is_name =
            |character: char| character.is_ascii_alphanumeric() || "_-.".contains(character);
        if !name.chars().all(is_name) || name.starts_with('.') {
            return Err(format!(
                "scenario: `{name}` is no name; it may have letters, digits, `_`, `-` and `.` only, and names a file of \
                 the publisher's scenario folder without its `.yaml`"
            ));
        }
        let path = folder.join(format!("{name}.yaml"));
        if !path.is_file() {
            return Err(format!(
                "scenario: there is no `{name}` in the publisher's scenario folder; there {}",
                self.named()
            ));
        }
        let scenario = read_scenario(&path).map_err(|failure| match failure {
            Failure::BadInput(error) | Failure::Failed(error) => format!("scenario: {error:#}"),
        })?;
        let problem = scenario.problem();
        Ok(TargetAnnouncement {
            revision: 0,
            name: scenario.name().to_owned(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: None,
        })
    }

    /// Which scenarios there are, for people.
    fn named(&self) -> String {
        let entries = self
            .folder
            .iter()
            .filter_map(|folder| folder.read_dir().ok());
        let mut names: Vec<String> = entries
            .flatten()
            .filter_map(|entry| {
                let name = entry.ok()?.file_name().into_string().ok()?;
                Some(name.strip_suffix(".yaml")?.to_owned())
            })
            .collect();
        names.sort();
        match names.len() {
            0 => "is none".to_owned(),
            count if count > NAMED_MAX => {
                names.truncate(NAMED_MAX);
                format!("are {} and {} more", names.join(", "), count - NAMED_MAX)
            }
            _ => format!("are {}", names.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use formation_msgs::{Edge, Spot, TargetConfiguration};

    use super::*;

    fn shipped() -> Wishes {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .unwrap();
        Wishes {
            folder: Some(root.join("launch_scripts/scenarios")),
            expected_modules: Some(7),
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
        for (name, told) in [
            ("singletons", "figure1_ladder17"),
            ("../scenarios/singletons_10", "is no name"),
            ("/etc/passwd", "is no name"),
            (".", "is no name"),
        ] {
            let reason = shipped().resolve(named(name)).unwrap_err();
            assert!(reason.contains(told), "{reason}");
        }
        let reason = Wishes::default().resolve(named("singletons_10"));
        assert!(reason.unwrap_err().contains("--scenario-folder"));
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
        let wishes = Wishes::default();
        let announcement = wishes.resolve(goal.clone()).unwrap();
        assert_eq!(announcement.target.unwrap().spots().len(), 2);
        assert_eq!(announcement.expected_modules, Some(3));
        goal.target.edges.clear();
        assert!(
            wishes
                .resolve(goal.clone())
                .unwrap_err()
                .starts_with("target: ")
        );
        goal.expected_modules = 10_001;
        assert!(
            wishes
                .resolve(goal.clone())
                .unwrap_err()
                .contains("at most 10000")
        );
        goal.expected_modules = 0;
        goal.target = TargetConfiguration {
            withdrawn: true,
            ..TargetConfiguration::default()
        };
        assert!(wishes.resolve(goal).unwrap_err().contains("withdrawn"));
    }
}
