//! What each role may publish, offer and call.

use formation_model::ModuleId;
use formation_node_support::topics::{self, Sender};
use ros_runtime::protection::Rights;

use crate::role::Role;

/// What every node publishes.
const OF_EVERY_NODE: [&str; 3] = ["/rosout", "/parameter_events", "/diagnostics"];

/// The services of every node.
const PARAMETER_SERVICES: [&str; 6] = [
    "*/describe_parameters",
    "*/get_parameters",
    "*/get_parameter_types",
    "*/list_parameters",
    "*/set_parameters",
    "*/set_parameters_atomically",
];

impl Role {
    fn of_sender(sender: Sender) -> Self {
        match sender {
            Sender::Module => Self::Module,
            Sender::TargetPublisher => Self::Publisher,
            Sender::Verifier => Self::Verifier,
            Sender::Operator => Self::Operator,
            Sender::Visualiser => Self::Observer,
        }
    }

    /// The topics that it publishes besides those of every node; absolute, or relative to the namespace of the formation.
    fn publishes(self) -> Vec<String> {
        let is_own = |sender: &Sender| Self::of_sender(*sender) == self;
        let listed = topics::all().into_iter();
        let listed = listed.filter(|listed| listed.senders.iter().any(is_own));
        let mut names: Vec<String> = listed.map(|listed| listed.topic.path()).collect();
        match self {
            Self::Module => {
                let of_any = topics::all_of_module(ModuleId(0));
                names.extend(of_any.map(|topic| format!("module_$*/{}", topic.name())));
            }
            Self::Publisher => names.extend(
                ["feedback", "status"].map(|part| format!("form_configuration/_action/{part}")),
            ),
            Self::Verifier | Self::Operator | Self::Observer => {}
        }
        names
    }

    /// The services that it offers besides those of every node.
    fn serves(self) -> &'static [&'static str] {
        match self {
            Self::Module => &[
                "*/add_module",
                "*/retire_module",
                "*/push_module",
                "*/remove_module",
            ],
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
        let below = |name: &str| match name.starts_with('/') {
            true => name.to_owned(),
            false => format!("{namespace}/{name}"),
        };
        let everything = vec![below("**")];
        let of_every_node = OF_EVERY_NODE.map(str::to_owned);
        let mut publish: Vec<String> = self.publishes().iter().map(|name| below(name)).collect();
        publish.extend(of_every_node.clone());
        let absolute = topics::all().into_iter().map(|listed| listed.topic.path());
        let absolute = absolute.filter(|name| name.starts_with('/'));
        let mut subscribe = everything.clone();
        subscribe.extend(of_every_node);
        subscribe.extend(absolute);
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
