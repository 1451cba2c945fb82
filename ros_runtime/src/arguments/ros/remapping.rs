//! Remapping rules: which names a node uses instead of its own.
//!
//! After the design article "Remapping Names" of ROS 2, without its wildcards, which ROS 2 does not have either. Of
//! several rules that match, the first holds, and no rule is applied to the outcome of another.

use std::str::FromStr;

use super::names::{self, Namespace, NodeIdentity};

/// No rule that could ever match is longer, in bytes.
const RULE_LENGTH_MAX: usize = 1_024;

/// What a name is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// Of a topic.
    Topic,
    /// Of a service, or of a part of an action.
    Service,
}

/// A rule, such as `claims:=decisions`, `camera:rostopic://~/image:=/image` or `__ns:=/fleet`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemapRule {
    /// The only node for which it holds.
    node: Option<String>,
    action: Action,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Action {
    NodeName(String),
    Namespace(Namespace),
    Name {
        only: Option<Resource>,
        from: String,
        to: String,
    },
}

impl FromStr for RemapRule {
    type Err = String;

    fn from_str(rule: &str) -> Result<Self, String> {
        parse(rule).map_err(|reason| format!("remapping rule `{rule}`: {reason}"))
    }
}

fn parse(rule: &str) -> Result<RemapRule, String> {
    if rule.len() > RULE_LENGTH_MAX {
        return Err(format!("is longer than {RULE_LENGTH_MAX} bytes"));
    }
    let (from, to) = rule
        .split_once(":=")
        .ok_or("must have the form `from:=to`")?;
    let (node, from) = split_node(from)?;
    let (only, from) = if let Some(name) = from.strip_prefix("rostopic://") {
        (Some(Resource::Topic), name)
    } else if let Some(name) = from.strip_prefix("rosservice://") {
        (Some(Resource::Service), name)
    } else {
        (None, from)
    };
    if from.contains("://") {
        return Err("only `rostopic://` and `rosservice://` can stand before a name".to_owned());
    }
    if to.contains("://") {
        return Err("the new name takes no `rostopic://` or `rosservice://`".to_owned());
    }
    let action = match from {
        "__ns" | "__node" | "__name" if only.is_some() => {
            return Err(format!("`{from}` is neither a topic nor a service"));
        }
        "__ns" => {
            let namespace = to.parse();
            Action::Namespace(namespace.map_err(|reason| format!("the namespace {reason}"))?)
        }
        "__node" | "__name" => {
            names::validate_node_name(to).map_err(|reason| format!("the node's name {reason}"))?;
            Action::NodeName(to.to_owned())
        }
        _ => {
            // A name that no node could use is refused at the start.
            let some_node = NodeIdentity {
                namespace: Namespace::default(),
                name: "node".to_owned(),
            };
            for name in [from, to] {
                let expanded = names::expand(name, &some_node);
                expanded.map_err(|reason| format!("`{name}` {reason}"))?;
            }
            Action::Name {
                only,
                from: from.to_owned(),
                to: to.to_owned(),
            }
        }
    };
    Ok(RemapRule { node, action })
}

/// Splits `node:rest`, where the colon of `scheme://` does not end a node's name.
pub(super) fn split_node(text: &str) -> Result<(Option<String>, &str), String> {
    match text.split_once(':') {
        Some((node, rest)) if !rest.starts_with("//") => {
            names::validate_node_name(node)
                .map_err(|reason| format!("the node's name before `:` {reason}"))?;
            Ok((Some(node.to_owned()), rest))
        }
        _ => Ok((None, text)),
    }
}

/// All rules, in the order in which they were given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RemapRules(pub Vec<RemapRule>);

impl RemapRules {
    /// The name and namespace, after remapping, of a node that calls itself `name` in `namespace`.
    ///
    /// Rules that name a node mean its own name where they rename it, and its new name in all else.
    #[must_use]
    pub fn identity(&self, name: &str, namespace: &Namespace) -> NodeIdentity {
        let name = self
            .of_node(name)
            .find_map(|action| match action {
                Action::NodeName(name) => Some(name.as_str()),
                _ => None,
            })
            .unwrap_or(name);
        let namespace = self
            .of_node(name)
            .find_map(|action| match action {
                Action::Namespace(namespace) => Some(namespace),
                _ => None,
            })
            .unwrap_or(namespace);
        NodeIdentity {
            namespace: namespace.clone(),
            name: name.to_owned(),
        }
    }

    /// The fully qualified name of the topic or service that `node` calls `name`.
    ///
    /// # Errors
    /// Says what is wrong with the name, or with the rule that matches it.
    pub fn resolve(
        &self,
        resource: Resource,
        name: &str,
        node: &NodeIdentity,
    ) -> Result<String, String> {
        let expanded = names::expand(name, node)?;
        for action in self.of_node(&node.name) {
            if let Action::Name { only, from, to } = action
                && only.is_none_or(|only| only == resource)
                && names::expand(from, node)? == expanded
            {
                return names::expand(to, node);
            }
        }
        Ok(expanded)
    }

    /// The actions of the rules that hold for a node.
    fn of_node<'a>(&'a self, node: &'a str) -> impl Iterator<Item = &'a Action> {
        let rules = self.0.iter();
        rules
            .filter(move |rule| rule.node.as_deref().is_none_or(|only| only == node))
            .map(|rule| &rule.action)
    }
}
