//! What each role may publish, offer and call.

use formation_msgs::topic;
use ros_runtime::protection::Rights;

use crate::role::Role;

/// What every node publishes.
const OF_EVERY_NODE: [&str; 3] = ["/rosout", "/parameter_events", "/diagnostics"];

/// The poses that a visualiser publishes.
const TRANSFORMS: [&str; 2] = ["/tf", "/tf_static"];

/// The services of every node.
const PARAMETER_SERVICES: [&str; 6] = [
    "*/describe_parameters",
    "*/get_parameters",
    "*/get_parameter_types",
    "*/list_parameters",
    "*/set_parameters",
    "*/set_parameters_atomically",
];

/// What the module or its driver publishes under the prefix of any module.
const OF_EACH_MODULE: [&str; 6] = [
    topic::GOAL_POSE,
    topic::PATH,
    topic::DOCKING,
    topic::POSE,
    topic::ODOMETRY,
    topic::DOCKING_RESULT,
];

impl Role {
    /// The topics that it publishes besides those of every node, in the namespace of the formation.
    fn publishes(self) -> Vec<String> {
        let names: &[&str] = match self {
            Self::Module => &[
                topic::MODULE_STATES,
                topic::ROSTER,
                topic::CLAIMS,
                topic::EVICTIONS,
                topic::HEARTBEATS,
            ],
            Self::Publisher => &[
                topic::TARGET,
                topic::COMMANDS,
                "form_configuration/_action/feedback",
                "form_configuration/_action/status",
            ],
            Self::Verifier => &[topic::VERDICT],
            Self::Operator => &[topic::COMMANDS],
            Self::Observer => &["markers"],
        };
        let own = names.iter().map(|&name| name.to_owned());
        let of_modules = OF_EACH_MODULE.map(|name| format!("module_$*/{name}"));
        let of_modules = of_modules.into_iter().filter(|_| self == Self::Module);
        own.chain(of_modules).collect()
    }

    /// The services that it offers besides those of every node.
    fn serves(self) -> &'static [&'static str] {
        match self {
            Self::Module => &["*/add_module", "*/retire_module", "*/remove_module"],
            Self::Publisher => &[
                "query_status",
                "withdraw_target",
                "stop_formation",
                "remove_module",
                "form_configuration/_action/send_goal",
                "form_configuration/_action/cancel_goal",
                "form_configuration/_action/get_result",
            ],
            Self::Verifier | Self::Operator | Self::Observer => &[],
        }
    }

    /// What it may do in the formation with this namespace. Every role may read every topic of the formation.
    pub fn rights(self, namespace: &str) -> Rights {
        let namespace = namespace.trim_end_matches('/');
        let below = |name: &str| format!("{namespace}/{name}");
        let absolute =
            |names: &[&str]| -> Vec<String> { names.iter().map(|&name| name.to_owned()).collect() };
        let everything = vec![below("**")];
        let own = self.publishes();
        let mut publish: Vec<String> = own.iter().map(|name| below(name)).collect();
        publish.extend(absolute(&OF_EVERY_NODE));
        if self == Self::Observer {
            publish.extend(absolute(&TRANSFORMS));
        }
        let mut subscribe = everything.clone();
        subscribe.extend(absolute(&OF_EVERY_NODE));
        subscribe.extend(absolute(&TRANSFORMS));
        let services = self.serves().iter().chain(&PARAMETER_SERVICES);
        Rights {
            common_name: self.name().to_owned(),
            publish,
            subscribe,
            serve: services.map(|name| below(name)).collect(),
            call: match self {
                Self::Operator => everything,
                Self::Module | Self::Publisher | Self::Verifier | Self::Observer => Vec::new(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The roles that may publish a topic.
    fn publishers(name: &str) -> Vec<Role> {
        let may = |role: &Role| role.rights("/formation").publish.contains(&name.to_owned());
        Role::ALL.into_iter().filter(may).collect()
    }

    #[test]
    fn what_moves_modules_comes_from_one_role() {
        assert_eq!(publishers("/formation/target"), [Role::Publisher]);
        assert_eq!(publishers("/formation/roster"), [Role::Module]);
        assert_eq!(publishers("/formation/claims"), [Role::Module]);
        assert_eq!(publishers("/formation/module_$*/goal_pose"), [Role::Module]);
        assert_eq!(publishers("/formation/verdict"), [Role::Verifier]);
        assert_eq!(
            publishers("/formation/commands"),
            [Role::Publisher, Role::Operator]
        );
        assert_eq!(publishers("/rosout"), Role::ALL);
    }

    #[test]
    fn only_operators_call_services() {
        let may = |role: &Role| !role.rights("/formation").call.is_empty();
        let callers: Vec<Role> = Role::ALL.into_iter().filter(may).collect();
        assert_eq!(callers, [Role::Operator]);
    }

    #[test]
    fn the_namespace_may_be_the_root() {
        assert!(
            Role::Verifier
                .rights("/")
                .publish
                .contains(&"/verdict".to_owned())
        );
    }
}
