//! Names of topics and services: what is valid, and how a name becomes fully qualified.
//!
//! After the design article "Topic and Service name mapping to DDS" of ROS 2.

use std::fmt;
use std::str::FromStr;

/// The longest fully qualified name: DDS allows 255 characters, and ROS 2 puts up to eight before and behind.
const NAME_LENGTH_MAX: usize = 247;

/// The namespace of a node and its topics, such as `/fleet`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Namespace(String);

impl Namespace {
    /// As ROS 2 writes it.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for Namespace {
    fn default() -> Self {
        Self("/".to_owned())
    }
}

impl FromStr for Namespace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let checked = match text.strip_prefix('/') {
            Some("") => Ok(()),
            Some(_) => validate(text),
            None => Err("must begin with `/`".to_owned()),
        };
        let wrong = |reason| format!("{reason}, in `{text}`");
        checked.map_err(wrong).map(|()| Self(text.to_owned()))
    }
}

impl fmt::Display for Namespace {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

/// A node's base name and its namespace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// The namespace.
    pub namespace: Namespace,
    /// The base name.
    pub name: String,
}

impl NodeIdentity {
    /// The fully qualified name, such as `/fleet/camera`.
    #[must_use]
    pub fn fully_qualified(&self) -> String {
        join(self.namespace.as_str(), &self.name)
    }

    /// The name of its logger, such as `fleet.camera`.
    #[must_use]
    pub fn logger(&self) -> String {
        let name = self.fully_qualified();
        name.trim_start_matches('/').replace('/', ".")
    }
}

/// Makes a name fully qualified: `/a` stays, `~/a` is private to the node, `a` is relative to its namespace, and
/// `{node}`, `{ns}` and `{namespace}` are replaced by the node's name and namespace.
pub(super) fn expand(name: &str, node: &NodeIdentity) -> Result<String, String> {
    let expanded = absolute(&substitute(name, node)?, node)?;
    validate(&expanded)?;
    Ok(expanded)
}

/// Replaces the words in braces.
fn substitute(name: &str, node: &NodeIdentity) -> Result<String, String> {
    let unpaired = || "has a `{` or `}` without its counterpart".to_owned();
    let mut result = String::new();
    let mut rest = name;
    while let Some(brace) = rest.find(['{', '}']) {
        let (before, after) = rest.split_at(brace);
        result.push_str(before);
        let inner = after.strip_prefix('{').ok_or_else(unpaired)?;
        let end = inner.find(['{', '}']).ok_or_else(unpaired)?;
        let (word, closed) = inner.split_at(end);
        rest = closed.strip_prefix('}').ok_or_else(unpaired)?;
        match word {
            "node" => result.push_str(&node.name),
            // The root namespace with its slash would double the one that follows.
            "ns" | "namespace" => result.push_str(node.namespace.as_str().trim_end_matches('/')),
            word => {
                return Err(format!(
                    "knows no `{{{word}}}`; there are `{{node}}`, `{{ns}}` and `{{namespace}}`"
                ));
            }
        }
    }
    result.push_str(rest);
    Ok(result)
}

/// Puts the namespace, and for a private name the node, before a name that does not begin with `/`.
fn absolute(name: &str, node: &NodeIdentity) -> Result<String, String> {
    if name.is_empty() {
        return Err("must not be empty".to_owned());
    }
    let expanded = match name.strip_prefix('~') {
        Some(rest) if rest.is_empty() || rest.starts_with('/') => node.fully_qualified() + rest,
        None if name.starts_with('/') => name.to_owned(),
        _ => join(node.namespace.as_str(), name),
    };
    if expanded.contains('~') {
        return Err("`~` must come first and be followed by `/`, as in `~/status`".to_owned());
    }
    Ok(expanded)
}

fn join(namespace: &str, name: &str) -> String {
    format!("{}/{name}", namespace.trim_end_matches('/'))
}

/// Checks a fully qualified name.
pub(super) fn validate(name: &str) -> Result<(), String> {
    let tokens = name.strip_prefix('/').unwrap_or(name);
    if tokens.is_empty() {
        return Err("must not be empty".to_owned());
    }
    if tokens.ends_with('/') {
        return Err("must not end with `/`".to_owned());
    }
    for token in tokens.split('/') {
        validate_token(token)?;
    }
    let length = name.chars().count();
    if length > NAME_LENGTH_MAX {
        return Err(format!(
            "must not be longer than {NAME_LENGTH_MAX} characters, but has {length}"
        ));
    }
    Ok(())
}

fn validate_token(token: &str) -> Result<(), String> {
    if token.is_empty() {
        return Err("must not have two slashes in a row".to_owned());
    }
    let is_other = |character: &char| !character.is_ascii_alphanumeric() && *character != '_';
    if let Some(other) = token.chars().find(is_other) {
        return Err(format!(
            "must consist of letters, digits, underscores and `/`, but has `{other}`"
        ));
    }
    if token.starts_with(|first: char| first.is_ascii_digit()) {
        return Err(format!(
            "no part of it may begin with a digit, but `{token}` does"
        ));
    }
    if token.contains("__") {
        return Err("must not have two underscores in a row".to_owned());
    }
    Ok(())
}

/// Checks the base name of a node.
pub(super) fn validate_node_name(name: &str) -> Result<(), String> {
    if name.is_empty() {
        return Err("must not be empty".to_owned());
    }
    validate_token(name)
}
