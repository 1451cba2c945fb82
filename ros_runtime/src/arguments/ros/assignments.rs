//! Assignments of parameters, from the command line and from parameter files.
//!
//! After the design article "ROS Command Line Arguments": an assignment that names a node takes precedence over one that
//! has a wildcard or names none; among equals, the one farther right, or farther down in a file, holds.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
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
pub struct Assignment {
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
pub struct ParameterAssignments(Vec<Assignment>);

impl ParameterAssignments {
    /// Adds `[node:]name:=value`.
    pub(super) fn add_argument(&mut self, argument: &str) -> Result<(), String> {
        let wrong = |reason: &str| format!("parameter assignment `{argument}`: {reason}");
        let (name, value) = argument
            .split_once(":=")
            .ok_or_else(|| wrong("must have the form `name:=value`"))?;
        let (node, name) = split_node(name).map_err(|reason| wrong(&reason))?;
        check_name(name).map_err(|reason| wrong(&reason))?;
        let yaml: Yaml = serde_yaml::from_str(value)
            .map_err(|error| wrong(&format!("the value is no YAML: {error}")))?;
        let value =
            parameter_value(&yaml).map_err(|reason| wrong(&format!("the value {reason}")))?;
        self.0.push(Assignment {
            names_node: node.is_some(),
            target: node.map_or(Target::Every, Target::Named),
            name: name.to_owned(),
            value,
            origin: Origin::CommandLine,
        });
        Ok(())
    }

    /// Adds the assignments of a parameter file.
    pub(super) fn add_file(&mut self, path: PathBuf, text: &str) -> Result<(), String> {
        let wrong =
            |reason: &dyn fmt::Display| format!("parameter file {}: {reason}", path.display());
        let yaml: Yaml = serde_yaml::from_str(text).map_err(|error| wrong(&error))?;
        let mut found = Vec::new();
        read_nodes("", yaml, &mut found).map_err(|reason| wrong(&reason))?;
        let origin = Origin::File(path.into());
        for (node, name, value) in found {
            check_pattern(&node)
                .map_err(|reason| format!("parameter file {origin}: node `{node}`: {reason}"))?;
            self.0.push(Assignment {
                names_node: !node.contains('*'),
                target: Target::Qualified(node),
                name,
                value,
                origin: origin.clone(),
            });
        }
        Ok(())
    }

    /// The assignments that hold for a node, by parameter.
    #[must_use]
    pub fn of_node(&self, node: &NodeIdentity) -> BTreeMap<&str, &Assignment> {
        let mut holding: BTreeMap<&str, &Assignment> = BTreeMap::new();
        for assignment in self.0.iter().filter(|assignment| assignment.is_for(node)) {
            match holding.get(assignment.name.as_str()) {
                Some(earlier) if earlier.names_node && !assignment.names_node => {}
                _ => {
                    holding.insert(&assignment.name, assignment);
                }
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
        files
            .into_iter()
            .filter(|(_, has_some)| !has_some)
            .map(|(path, _)| path)
            .collect()
    }
}

impl Assignment {
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

/// Descends through namespaces and nodes to `ros__parameters`. The parser bounds the nesting of a file.
fn read_nodes(
    node: &str,
    yaml: Yaml,
    found: &mut Vec<(String, String, ParameterValue)>,
) -> Result<(), String> {
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
        if key == PARAMETERS_KEY {
            if node.is_empty() {
                return Err(format!(
                    "`{PARAMETERS_KEY}` must stand below a node, or below `/**` for all nodes"
                ));
            }
            read_parameters(node, "", value, found)?;
        } else {
            let name = format!("{node}/{}", key.trim_matches('/'));
            read_nodes(&name, value, found)?;
        }
    }
    Ok(())
}

fn read_parameters(
    node: &str,
    prefix: &str,
    yaml: Yaml,
    found: &mut Vec<(String, String, ParameterValue)>,
) -> Result<(), String> {
    let entries = match yaml {
        Yaml::Mapping(entries) => entries,
        Yaml::Null => return Ok(()),
        _ => return Err(format!("`{PARAMETERS_KEY}` of `{node}` must be a mapping")),
    };
    for (key, value) in entries {
        let name = if prefix.is_empty() {
            key
        } else {
            format!("{prefix}.{key}")
        };
        if let Yaml::Mapping(_) = value {
            read_parameters(node, &name, value, found)?;
            continue;
        }
        let wrong = |reason: String| format!("parameter `{name}` of `{node}` {reason}");
        check_name(&name).map_err(wrong)?;
        let value = parameter_value(&value).map_err(wrong)?;
        found.push((node.to_owned(), name, value));
    }
    Ok(())
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
            "`{name}` is no name of a parameter: it must consist of words separated by `.`"
        ))
    }
}
