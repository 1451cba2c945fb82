//! Which modules a process hosts, and what they know of themselves.

use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::Args;
use formation_model::{ConfigurationId, ModuleId, NO_ID, Pose, PoseError, Scenario};
use formation_protocol::Identity;

use formation_node_support::scenario::read_own_scenario;
use formation_node_support::{ModuleList, stamp};
use ros_runtime::exit::Failure;
use ros_runtime::settings::Settings;

/// Which modules a process hosts: those of a scenario file, or one that the arguments describe.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Modules")]
pub struct ModuleArguments {
    /// The module that this process hosts
    #[arg(long, value_name = "ID", required_unless_present = "modules")]
    pub module: Option<u32>,
    /// Several modules, all hosted by this process on one DDS participant, such as `1-25` or `1,4,7-9`
    #[arg(
        long,
        value_name = "LIST",
        conflicts_with = "module",
        requires = "scenario"
    )]
    pub modules: Option<ModuleList>,
    /// Scenario file that says where the modules stand and how they are docked
    #[arg(long, value_name = "FILE", conflicts_with_all = ["x", "y", "theta", "link", "configuration", "leader"])]
    pub scenario: Option<PathBuf>,
    /// Position in units of `module_size`, without a scenario
    #[arg(
        long,
        value_name = "UNITS",
        allow_negative_numbers = true,
        required_unless_present = "scenario"
    )]
    pub x: Option<f64>,
    /// Position in units of `module_size`, without a scenario
    #[arg(
        long,
        value_name = "UNITS",
        allow_negative_numbers = true,
        required_unless_present = "scenario"
    )]
    pub y: Option<f64>,
    /// Heading in radians, without a scenario [default: 0]
    #[arg(long, value_name = "RADIANS", allow_negative_numbers = true)]
    pub theta: Option<f64>,
    /// A module that it is docked to, without a scenario; may be repeated
    #[arg(long, value_name = "ID")]
    pub link: Vec<u32>,
    /// The initial configuration to which it belongs, without a scenario
    #[arg(long, value_name = "ID")]
    pub configuration: Option<u32>,
    /// The module that leads its configuration, without a scenario
    #[arg(long, value_name = "ID")]
    pub leader: Option<u32>,
}

/// The modules to host, and the frame of their poses.
#[derive(Clone, Debug)]
pub struct HostedModules {
    /// Identity and initial state of each module.
    pub modules: Vec<Identity>,
    /// The frame of all poses (REP-105).
    pub frame_id: String,
    /// The scenario from which they come, if they come from one.
    pub scenario: Option<Scenario>,
}

impl ModuleArguments {
    /// What the modules know of themselves; a scenario also gives their size.
    ///
    /// # Errors
    /// Names the file, field or argument that is wrong.
    pub fn resolve(&self, settings: &mut Settings) -> Result<HostedModules, Failure> {
        let listed: Vec<ModuleId> = match (&self.modules, self.module) {
            (Some(list), _) => list.modules().to_vec(),
            (None, Some(id)) => vec![identifier("--module", id)?],
            (None, None) => return Err(Failure::bad_input("--module or --modules is required")),
        };
        match &self.scenario {
            Some(path) => {
                HostedModules::from_scenario(&listed, &read_own_scenario(path, settings)?).map_err(
                    |reason| Failure::bad_input(format_args!("{}: {reason}", path.display())),
                )
            }
            // Not left to clap, which lets `--x` excuse the missing scenario.
            None if self.modules.is_some() => {
                Err(Failure::bad_input("--modules needs a --scenario"))
            }
            None => Ok(HostedModules {
                modules: vec![self.described(listed[0])?],
                frame_id: "map".to_owned(),
                scenario: None,
            }),
        }
    }

    fn described(&self, module: ModuleId) -> Result<Identity, Failure> {
        let (Some(x), Some(y)) = (self.x, self.y) else {
            return Err(Failure::bad_input(
                "--x and --y are required without a scenario",
            ));
        };
        let pose = Pose::from_units(x, y, self.theta.unwrap_or_default()).map_err(
            |PoseError { coordinate, source }| {
                Failure::bad_input(format_args!("--{coordinate}: {source}"))
            },
        )?;
        let mut links = BTreeSet::new();
        for &id in &self.link {
            let other = identifier("--link", id)?;
            if other == module {
                return Err(Failure::bad_input(format_args!(
                    "--link: {module} cannot be docked to itself"
                )));
            }
            if !links.insert(other) {
                return Err(Failure::bad_input(format_args!(
                    "--link: {other} is given twice"
                )));
            }
        }
        let configuration = self
            .configuration
            .map(|id| identifier("--configuration", id).map(|ModuleId(id)| ConfigurationId(id)));
        Ok(Identity {
            links,
            configuration: configuration.transpose()?,
            leader: self
                .leader
                .map(|id| identifier("--leader", id))
                .transpose()?,
            ..single_module(module, pose)
        })
    }
}

/// A module that begins a run at this pose, without a store and docked to none.
pub(crate) fn single_module(module: ModuleId, pose: Pose) -> Identity {
    Identity::single(module.run(stamp::incarnation()), pose)
}

fn identifier(argument: &str, id: u32) -> Result<ModuleId, Failure> {
    if id == NO_ID {
        return Err(Failure::bad_input(format_args!(
            "{argument}: {NO_ID} is reserved and cannot be used"
        )));
    }
    Ok(ModuleId(id))
}

impl HostedModules {
    /// Those modules, as a scenario has them.
    ///
    /// # Errors
    /// Names the module that is not in the scenario.
    pub fn from_scenario(listed: &[ModuleId], scenario: &Scenario) -> Result<Self, String> {
        let problem = scenario.problem();
        let modules = listed
            .iter()
            .map(|&id| {
                let module = problem
                    .module(id)
                    .ok_or_else(|| format!("there is no {id} in this scenario"))?;
                Ok(Identity::of(module, stamp::incarnation()))
            })
            .collect::<Result<_, String>>()?;
        Ok(Self {
            modules,
            frame_id: problem.target().frame_id().to_owned(),
            scenario: Some(scenario.clone()),
        })
    }
}

/// Refuses a module that does not lead a configuration of the scenario.
///
/// # Errors
/// Says who leads instead.
pub fn require_leader(scenario: &Scenario, module: ModuleId) -> Result<(), String> {
    let problem = scenario.problem();
    if problem.module(module).is_none() {
        return Err(format!("there is no {module} in this scenario"));
    }
    let configuration = problem
        .configurations()
        .into_iter()
        .find(|configuration| configuration.modules.contains(&module));
    match configuration {
        Some(configuration) if configuration.leader == module => Ok(()),
        Some(configuration) => Err(format!(
            "{module} does not lead its configuration, {} does; start it with `module_agent`",
            configuration.leader
        )),
        None => Err(format!(
            "{module} belongs to no configuration, so it leads none; start it with `module_agent`"
        )),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        modules: ModuleArguments,
    }

    fn resolved(arguments: &str) -> Result<Vec<Identity>, String> {
        let words = std::iter::once("test").chain(arguments.split_whitespace());
        let command = Command::try_parse_from(words).map_err(|error| error.to_string())?;
        let hosted = command.modules.resolve(&mut Settings::default());
        hosted
            .map(|hosted| hosted.modules)
            .map_err(|failure| failure.to_string())
    }

    const SCENARIO: &str = "
target: {spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}, {id: 3, x: 7.0, y: 5.0}], edges: [[1, 2], [2, 3]]}
configurations:
  - {id: 7, leader: 5, modules: [{id: 4, x: 1.0, y: 2.0}, {id: 5, x: 2.0, y: 2.0}], edges: [[4, 5]]}
singletons: [{id: 17, x: 3.0, y: 9.5, theta: 1.2}]
";

    #[test]
    fn a_module_can_be_described_without_a_scenario() {
        let identities =
            resolved("--module 4 --x 1.5 --y -2 --link 6 --link 5 --configuration 1 --leader 4")
                .unwrap();
        assert_eq!(
            identities[0].pose,
            Pose::from_units(1.5, -2.0, 0.0).unwrap()
        );
        assert_eq!(identities[0].links, [ModuleId(5), ModuleId(6)].into());
        assert_eq!(identities[0].leader, Some(ModuleId(4)));
        for (bad, error) in [
            (
                "--module 4 --x NaN --y 0",
                "--x: must be a finite number, got NaN",
            ),
            (
                "--module 4 --x 0 --y 0 --link 4",
                "--link: module 4 cannot be docked to itself",
            ),
            (
                "--module 4 --x 0 --y 0 --link 5 --link 5",
                "--link: module 5 is given twice",
            ),
            ("--modules 1-2 --x 0 --y 0", "--modules needs a --scenario"),
            (
                "--module 4294967295 --x 0 --y 0",
                "--module: 4294967295 is reserved and cannot be used",
            ),
        ] {
            assert_eq!(resolved(bad).unwrap_err(), error);
        }
        for usage in ["--x 1 --y 1", "--module 4", "--module 4 --modules 5"] {
            assert!(resolved(usage).unwrap_err().contains("Usage"), "{usage}");
        }
    }

    #[test]
    fn a_scenario_says_where_the_modules_stand() {
        let scenario = Scenario::from_yaml(SCENARIO).unwrap();
        let hosted = HostedModules::from_scenario(&[ModuleId(4), ModuleId(17)], &scenario).unwrap();
        assert_eq!(hosted.frame_id, "map");
        assert_eq!(hosted.modules[0].links, [ModuleId(5)].into());
        assert_eq!(hosted.modules[0].leader, Some(ModuleId(5)));
        assert_eq!(hosted.modules[1].configuration, None);
        assert_eq!(
            HostedModules::from_scenario(&[ModuleId(9)], &scenario).unwrap_err(),
            "there is no module 9 in this scenario"
        );
    }

    #[test]
    fn only_leaders_lead() {
        let scenario = Scenario::from_yaml(SCENARIO).unwrap();
        assert_eq!(require_leader(&scenario, ModuleId(5)), Ok(()));
        let refused = |id| require_leader(&scenario, ModuleId(id)).unwrap_err();
        assert!(refused(4).starts_with("module 4 does not lead its configuration, module 5 does"));
        assert!(refused(17).starts_with("module 17 belongs to no configuration"));
        assert_eq!(refused(9), "there is no module 9 in this scenario");
    }

    #[test]
    fn a_file_that_cannot_be_read_is_named() {
        let error = resolved("--module 4 --scenario /nowhere/scenario.yaml").unwrap_err();
        assert!(error.starts_with("/nowhere/scenario.yaml: "), "{error}");
    }
}
