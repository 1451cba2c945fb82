//! Assignments of parameters, from the command line and from parameter files.
//!
//! After the design article "ROS Command Line Arguments": an assignment that names a node takes precedence over one that
//! has a wildcard or names none; among equals, the one farther right, or farther down in a file, holds.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use ros2_client::ParameterValue;

use super::names::{self, NodeIdentity};
use super::remapping::split_node;
use super::yaml::{Yaml, parameter_value};

/// The key below which the parameters of a node stand.
const PARAMETERS_KEY: &str = "ros__parameters";

/// Where an assignment comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// On the command line.
    CommandLine,
    /// In a parameter file.
    File(Arc<Path>),
}

impl fmt::Display for Origin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CommandLine => formatter.write_str("the command line"),
            Self::File(path) => path.display().fmt(formatter),
        }
    }
}

/// The nodes for which an assignment holds.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    Every,
    /// By base name, in any namespace.
    Named(String),
    /// By fully qualified name, in which there may be wildcards.
    Qualified(String),
}

/// A value for a parameter of some nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterAssignment {
    target: Target,
    /// The parameter's name.
    pub name: String,
    /// Its value, of the type that YAML gives it.
    pub value: ParameterValue,
    /// Where it comes from.
    pub origin: Origin,
    /// Whether it names one node, rather than all or some.
    pub names_node: bool,
}

/// All assignments, in the order in which they were given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterAssignments(Vec<ParameterAssignment>);

impl ParameterAssignments {
    /// Adds `[node:]name:=value`.
    pub(super) fn add_argument(&mut self, argument: &str) -> Result<(), String> {
        let assignment = parse_argument(argument)
            .map_err(|reason| format!("parameter assignment `{argument}`: {reason}"))?;
        self.0.push(assignment);
        Ok(())
    }

    /// Adds the assignments of a parameter file.
    pub(super) fn add_file(&mut self, path: &Path, text: &str) -> Result<(), String> {
        let origin = Origin::File(path.into());
        let yaml = serde_yaml::from_str(text).map_err(|error| error.to_string());
        yaml.and_then(|yaml| self.add_nodes("", yaml, &origin))
            .map_err(|reason| format!("parameter file {origin}: {reason}"))
    }

    /// Descends through namespaces and nodes to `ros__parameters`. The parser bounds the nesting of a file.
    fn add_nodes(&mut self, node: &str, yaml: Yaml, origin: &Origin) -> Result<(), String> {
        let entries = match yaml {
            Yaml::Mapping(entries) => entries,
            Yaml::Null if node.is_empty() => return Ok(()),
            _ => {
                return Err(format!(
                    "`{node}` must have parameters below `{PARAMETERS_KEY}`"
                ));
            }
        };
        for (key, value) in entries {
            if key != PARAMETERS_KEY {
                let name = format!("{node}/{}", key.trim_matches('/'));
                self.add_nodes(&name, value, origin)?;
                continue;
            }
            if node.is_empty() {
                return Err(format!(
                    "`{PARAMETERS_KEY}` must stand below a node, or below `/**` for all nodes"
                ));
            }
            check_pattern(node).map_err(|reason| format!("node `{node}`: {reason}"))?;
            match value {
                Yaml::Null => {}
                Yaml::Mapping(_) => self.add_parameters(node, "", value, origin)?,
                _ => return Err(format!("`{PARAMETERS_KEY}` of `{node}` must be a mapping")),
            }
        }
        Ok(())
    }

    /// Descends through the parts of a parameter's name.
    fn add_parameters(
        &mut self,
        node: &str,
        name: &str,
        yaml: Yaml,
        origin: &Origin,
    ) -> Result<(), String> {
        if let Yaml::Mapping(entries) = yaml {
            for (key, value) in entries {
                let name = [name, &key].join(if name.is_empty() { "" } else { "." });
                self.add_parameters(node, &name, value, origin)?;
            }
            return Ok(());
        }
        let value = check_name(name).and_then(|()| parameter_value(yaml));
        self.0.push(ParameterAssignment {
            names_node: !node.contains('*'),
            target: Target::Qualified(node.to_owned()),
            name: name.to_owned(),
            value: value.map_err(|reason| format!("parameter `{name}` of `{node}` {reason}"))?,
            origin: origin.clone(),
        });
        Ok(())
    }

    /// The assignments that hold for a node, by parameter.
    #[must_use]
    pub fn of_node(&self, node: &NodeIdentity) -> BTreeMap<&str, &ParameterAssignment> {
        let mut holding: BTreeMap<&str, &ParameterAssignment> = BTreeMap::new();
        for assignment in self.0.iter().filter(|assignment| assignment.is_for(node)) {
            let earlier = holding.get(assignment.name.as_str());
            if !earlier.is_some_and(|earlier| earlier.names_node && !assignment.names_node) {
                holding.insert(&assignment.name, assignment);
            }
        }
        holding
    }

    /// The parameter files that assign nothing to this node.
    #[must_use]
    pub fn files_without(&self, node: &NodeIdentity) -> Vec<&Path> {
        let mut files: BTreeMap<&Path, bool> = BTreeMap::new();
        for assignment in &self.0 {
            if let Origin::File(path) = &assignment.origin {
                *files.entry(path).or_default() |= assignment.is_for(node);
            }
        }
        files.retain(|_, assigns| !*assigns);
        files.into_keys().collect()
    }
}

fn parse_argument(argument: &str) -> Result<ParameterAssignment, String> {
    let (name, value) = argument
        .split_once(":=")
        .ok_or("must have the form `name:=value`")?;
    let (node, name) = split_node(name)?;
    check_name(name)?;
    let yaml = serde_yaml::from_str(value);
    let yaml = yaml.map_err(|error| format!("the value is not YAML: {error}"))?;
    Ok(ParameterAssignment {
        names_node: node.is_some(),
        target: node.map_or(Target::Every, Target::Named),
        name: name.to_owned(),
        value: parameter_value(yaml).map_err(|reason| format!("the value {reason}"))?,
        origin: Origin::CommandLine,
    })
}

impl ParameterAssignment {
    fn is_for(&self, node: &NodeIdentity) -> bool {
        match &self.target {
            Target::Every => true,
            Target::Named(name) => *name == node.name,
            Target::Qualified(pattern) => is_match(pattern, &node.fully_qualified()),
        }
    }
}

/// Checks the name of a node in which `*` stands for one part between slashes, and `**` for any number of parts.
fn check_pattern(pattern: &str) -> Result<(), String> {
    let parts = pattern.split('/').map(|part| match part {
        "*" | "**" => "any",
        part => part,
    });
    names::validate(&parts.collect::<Vec<_>>().join("/"))
}

/// Whether a name matches a pattern: like a glob, whose characters are the parts between slashes.
fn is_match(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<&str>, Vec<&str>) =
        (pattern.split('/').collect(), name.split('/').collect());
    let (mut at, mut part) = (0, 0);
    // Where the last `**` stands, and the part up to which it matches.
    let mut last: Option<(usize, usize)> = None;
    while part < name.len() {
        match pattern.get(at) {
            Some(&"**") => {
                last = Some((at, part));
                at += 1;
            }
            Some(&token) if token == "*" || token == name[part] => {
                at += 1;
                part += 1;
            }
            _ => match &mut last {
                Some((many, matched)) => {
                    *matched += 1;
                    (at, part) = (*many + 1, *matched);
                }
                None => return false,
            },
        }
    }
    pattern[at..].iter().all(|token| *token == "**")
}

fn check_name(name: &str) -> Result<(), String> {
    let is_token = |token: &str| {
        !token.is_empty()
            && token
                .chars()
                .all(|character| character.is_ascii_alphanumeric() || "_-/".contains(character))
    };
    if name.split('.').all(is_token) {
        Ok(())
    } else {
        Err(format!(
            "`{name}` is not the name of a parameter: it must consist of words separated by `.`"
        ))
    }
}
