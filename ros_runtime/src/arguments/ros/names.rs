//! Names of topics and services: what is valid, and how a name becomes fully qualified.
//!
//! After the design article "Topic and Service name mapping to DDS" of ROS 2.

use thiserror::Error;

use crate::environment::Namespace;

/// The longest fully qualified name: DDS allows 255 characters, and ROS 2 puts up to eight before and behind.
const NAME_LENGTH_MAX: usize = 247;

/// Whose names these are: a node's base name and the namespace that it is in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// The namespace.
    pub namespace: Namespace,
    /// The base name.
    pub name: String,
}

impl NodeIdentity {
    /// The fully qualified name, such as `/formation/module_4`.
    #[must_use]
    pub fn fully_qualified(&self) -> String {
        join(self.namespace.as_str(), &self.name)
    }

    /// The name of its logger, such as `formation.module_4`.
    #[must_use]
    pub fn logger(&self) -> String {
        self.fully_qualified()
            .trim_start_matches('/')
            .replace('/', ".")
    }
}

/// What is wrong with a name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NameError {
    /// There is nothing.
    #[error("must not be empty")]
    Empty,
    /// Only letters, digits, underscores and slashes can stand in a name.
    #[error("must consist of letters, digits, underscores and `/`, but has `{0}`")]
    Character(char),
    /// No token begins with a digit.
    #[error("no part of it may begin with a digit, but `{0}` does")]
    LeadingDigit(String),
    /// Two underscores are reserved.
    #[error("must not have two underscores in a row")]
    RepeatedUnderscore,
    /// Two slashes have nothing between them.
    #[error("must not have two slashes in a row")]
    RepeatedSlash,
    /// A name ends with a token.
    #[error("must not end with `/`")]
    TrailingSlash,
    /// `~` is the whole first token.
    #[error("`~` must come first and be followed by `/`, as in `~/status`")]
    Tilde,
    /// Braces come in pairs and are not nested.
    #[error("has a `{{` or `}}` without its counterpart")]
    Brace,
    /// Only some words can stand in braces.
    #[error("knows no `{{{0}}}`; there are `{{node}}`, `{{ns}}` and `{{namespace}}`")]
    Substitution(String),
    /// DDS has a limit.
    #[error("must not be longer than {NAME_LENGTH_MAX} characters, but has {0}")]
    TooLong(usize),
}

/// Makes a name fully qualified: `/a` stays, `~/a` is private to the node, `a` is relative to its namespace, and
/// `{node}`, `{ns}` and `{namespace}` stand for what they say.
///
/// # Errors
/// Says what is wrong with the name.
pub fn expand(name: &str, node: &NodeIdentity) -> Result<String, NameError> {
    let expanded = absolute(&substitute(name, node)?, node)?;
    validate(&expanded)?;
    Ok(expanded)
}

/// Replaces what stands in braces.
pub(super) fn substitute(name: &str, node: &NodeIdentity) -> Result<String, NameError> {
    let mut result = String::new();
    let mut rest = name;
    while let Some(brace) = rest.find(['{', '}']) {
        let (before, after) = rest.split_at(brace);
        result.push_str(before);
        let inner = after.strip_prefix('{').ok_or(NameError::Brace)?;
        let end = inner.find(['{', '}']).ok_or(NameError::Brace)?;
        if inner[end..].starts_with('{') {
            return Err(NameError::Brace);
        }
        match &inner[..end] {
            "node" => result.push_str(&node.name),
            // The root namespace with its slash would double the one that follows.
            "ns" | "namespace" => result.push_str(node.namespace.as_str().trim_end_matches('/')),
            unknown => return Err(NameError::Substitution(unknown.to_owned())),
        }
        rest = &inner[end + 1..];
    }
    result.push_str(rest);
    Ok(result)
}

/// Puts the namespace, and for a private name the node, before a name that does not begin with `/`.
pub(super) fn absolute(name: &str, node: &NodeIdentity) -> Result<String, NameError> {
    if name.is_empty() {
        return Err(NameError::Empty);
    }
    let expanded = match name.strip_prefix('~') {
        Some("") => node.fully_qualified(),
        Some(rest) if rest.starts_with('/') => format!("{}{rest}", node.fully_qualified()),
        Some(_) => return Err(NameError::Tilde),
        None if name.starts_with('/') => name.to_owned(),
        None => join(node.namespace.as_str(), name),
    };
    if expanded.contains('~') {
        return Err(NameError::Tilde);
    }
    Ok(expanded)
}

fn join(namespace: &str, name: &str) -> String {
    format!("{}/{name}", namespace.trim_end_matches('/'))
}

/// Checks a fully qualified name.
pub(super) fn validate(name: &str) -> Result<(), NameError> {
    let tokens = name.strip_prefix('/').unwrap_or(name);
    if tokens.is_empty() {
        return Err(NameError::Empty);
    }
    if tokens.ends_with('/') {
        return Err(NameError::TrailingSlash);
    }
    for token in tokens.split('/') {
        validate_token(token)?;
    }
    match name.chars().count() {
        length if length > NAME_LENGTH_MAX => Err(NameError::TooLong(length)),
        _ => Ok(()),
    }
}

fn validate_token(token: &str) -> Result<(), NameError> {
    if token.is_empty() {
        return Err(NameError::RepeatedSlash);
    }
    if let Some(other) = token
        .chars()
        .find(|character| !character.is_ascii_alphanumeric() && *character != '_')
    {
        return Err(NameError::Character(other));
    }
    if token.starts_with(|first: char| first.is_ascii_digit()) {
        return Err(NameError::LeadingDigit(token.to_owned()));
    }
    if token.contains("__") {
        return Err(NameError::RepeatedUnderscore);
    }
    Ok(())
}

/// Checks the base name of a node.
pub(super) fn validate_node_name(name: &str) -> Result<(), NameError> {
    if name.is_empty() {
        return Err(NameError::Empty);
    }
    validate_token(name)
}
