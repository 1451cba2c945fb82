//! Remapping rules: which names a node uses instead of its own.
//!
//! After the design article "Remapping Names" of ROS 2, its wildcards included. Of several rules that fit, the first
//! holds, and no rule is applied to the outcome of another.

use std::str::FromStr;

use thiserror::Error;

use super::names::{self, NameError, NodeIdentity};
use crate::environment::Namespace;

/// More wildcards than `\1` to `\9` can name are of no use.
const WILDCARDS_MAX: usize = 9;
/// No rule that could ever fit is longer.
const RULE_LENGTH_MAX: usize = 1_024;

/// What a name is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// Of a topic.
    Topic,
    /// Of a service, or of a part of an action.
    Service,
}

/// A rule, such as `claims:=decisions`, `module_4:rostopic://~/pose:=/odometry` or `__ns:=/fleet`.
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
        pattern: String,
        replacement: String,
    },
}

/// Why a remapping rule cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("remapping rule `{rule}`: {reason}")]
pub struct RemapError {
    /// The rule as it was given.
    pub rule: String,
    /// What is wrong with it.
    pub reason: String,
}

impl FromStr for RemapRule {
    type Err = RemapError;

    fn from_str(rule: &str) -> Result<Self, RemapError> {
        parse(rule).map_err(|reason| RemapError {
            rule: rule.to_owned(),
            reason,
        })
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
    let (only, from) = [
        ("rostopic://", Resource::Topic),
        ("rosservice://", Resource::Service),
    ]
    .into_iter()
    .find_map(|(scheme, resource)| Some((Some(resource), from.strip_prefix(scheme)?)))
    .unwrap_or((None, from));
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
        "__ns" => Action::Namespace(
            to.parse()
                .map_err(|reason| format!("the namespace {reason}"))?,
        ),
        "__node" | "__name" => {
            names::validate_node_name(to).map_err(|reason| format!("the node's name {reason}"))?;
            Action::NodeName(to.to_owned())
        }
        _ => {
            check(from, to)?;
            Action::Name {
                only,
                pattern: from.to_owned(),
                replacement: to.to_owned(),
            }
        }
    };
    Ok(RemapRule { node, action })
}

/// Splits `node:rest`, where the colon of `scheme://` is none of a node's.
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

/// Tries the rule for some node, so that what is wrong in itself is told at the start.
fn check(from: &str, to: &str) -> Result<(), String> {
    let node = NodeIdentity {
        namespace: Namespace::default(),
        name: "node".to_owned(),
    };
    let pattern = Pattern::parse(from, &node).map_err(|reason| format!("`{from}` {reason}"))?;
    let captures: Vec<Capture> = pattern
        .tokens
        .iter()
        .filter(|token| !matches!(token, Token::Literal(_)))
        .map(|_| Capture {
            tokens: vec!["token".to_owned()],
            is_from_the_root: false,
        })
        .collect();
    replace(to, &captures, &node).map_err(|reason| format!("`{to}` {reason}"))?;
    Ok(())
}

/// All rules, in the order in which they were given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RemapRules(pub Vec<RemapRule>);

impl RemapRules {
    /// What a node is called, and where it is, that calls itself `name` in `namespace`.
    ///
    /// Rules that name a node mean its own name where they rename it, and its new name in all else.
    #[must_use]
    pub fn identity(&self, name: &str, namespace: &Namespace) -> NodeIdentity {
        let name = self
            .fitting(name)
            .find_map(|action| match action {
                Action::NodeName(name) => Some(name.as_str()),
                _ => None,
            })
            .unwrap_or(name);
        let namespace = self
            .fitting(name)
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

    /// The fully qualified name of a topic or service that `node` knows as `name`.
    ///
    /// # Errors
    /// Says what is wrong with the name, or with the rule that fits it.
    pub fn resolve(
        &self,
        resource: Resource,
        name: &str,
        node: &NodeIdentity,
    ) -> Result<String, RemapError> {
        let wrong = |rule: &str, reason: &dyn ToString| RemapError {
            rule: rule.to_owned(),
            reason: reason.to_string(),
        };
        let expanded = names::expand(name, node).map_err(|reason| wrong(name, &reason))?;
        for action in self.fitting(&node.name) {
            let Action::Name {
                only,
                pattern,
                replacement,
            } = action
            else {
                continue;
            };
            if only.is_some_and(|only| only != resource) {
                continue;
            }
            let rule = || format!("{pattern}:={replacement}");
            let captures = Pattern::parse(pattern, node)
                .map_err(|reason| wrong(&rule(), &reason))?
                .captures(&expanded);
            if let Some(captures) = captures {
                return replace(replacement, &captures, node)
                    .map_err(|reason| wrong(&rule(), &reason));
            }
        }
        Ok(expanded)
    }

    fn fitting<'a>(&'a self, node: &'a str) -> impl Iterator<Item = &'a Action> {
        self.0
            .iter()
            .filter(move |rule| rule.node.as_deref().is_none_or(|only| only == node))
            .map(|rule| &rule.action)
    }
}

enum Token {
    Literal(String),
    /// `*`: one token.
    One,
    /// `**`: any number of tokens.
    Many,
}

/// A name in which `*` stands for one part between slashes and `**` for any number of them.
pub(super) struct Pattern {
    tokens: Vec<Token>,
    /// Whether the first wildcard stands where the root's slash would.
    begins_with_wildcard: bool,
}

/// What a wildcard stood for.
pub(super) struct Capture {
    tokens: Vec<String>,
    /// Whether it begins with the slash of the root, so that a name made of it is fully qualified.
    is_from_the_root: bool,
}

impl Pattern {
    pub(super) fn parse(text: &str, node: &NodeIdentity) -> Result<Self, PatternError> {
        let text = names::substitute(text, node)?;
        let begins_with_wildcard = text.starts_with('*');
        let expanded = if begins_with_wildcard {
            format!("/{text}")
        } else {
            names::absolute(&text, node)?
        };
        let mut tokens = Vec::new();
        // Wildcards count as names here, so that all else is checked as usual.
        let mut plain = String::new();
        for token in expanded[1..].split('/') {
            plain.push('/');
            tokens.push(match token {
                "*" => Token::One,
                "**" => Token::Many,
                literal if literal.contains('*') => {
                    return Err(PatternError::PartialWildcard(literal.to_owned()));
                }
                literal => Token::Literal(literal.to_owned()),
            });
            plain.push_str(if token.contains('*') { "w" } else { token });
        }
        names::validate(&plain)?;
        let wildcards = tokens
            .iter()
            .filter(|token| !matches!(token, Token::Literal(_)));
        if wildcards.count() > WILDCARDS_MAX {
            return Err(PatternError::Wildcards);
        }
        Ok(Self {
            tokens,
            begins_with_wildcard,
        })
    }

    /// Whether it has a wildcard at all.
    pub(super) fn has_wildcard(&self) -> bool {
        self.tokens
            .iter()
            .any(|token| !matches!(token, Token::Literal(_)))
    }

    /// What the wildcards stand for, if the name fits.
    ///
    /// `**` takes as many tokens as it can; at the end of a pattern it takes at least one, as `/a/**` means what is
    /// below `/a`.
    pub(super) fn captures(&self, name: &str) -> Option<Vec<Capture>> {
        let name: Vec<&str> = name.strip_prefix('/')?.split('/').collect();
        let (pattern_length, name_length) = (self.tokens.len(), name.len());
        // fits[p][n]: whether the pattern from p on fits the name from n on.
        let mut fits = vec![vec![false; name_length + 1]; pattern_length + 1];
        fits[pattern_length][name_length] = true;
        for p in (0..pattern_length).rev() {
            for n in (0..=name_length).rev() {
                fits[p][n] = match &self.tokens[p] {
                    Token::Literal(token) => {
                        name.get(n) == Some(&token.as_str()) && fits[p + 1][n + 1]
                    }
                    Token::One => n < name_length && fits[p + 1][n + 1],
                    Token::Many if p + 1 == pattern_length => n < name_length,
                    Token::Many => fits[p + 1][n] || (n < name_length && fits[p][n + 1]),
                };
            }
        }
        if !fits[0][0] {
            return None;
        }
        let mut captures = Vec::new();
        let mut n = 0;
        for (p, token) in self.tokens.iter().enumerate() {
            let taken = match token {
                Token::Literal(_) => {
                    n += 1;
                    continue;
                }
                Token::One => 1,
                Token::Many => (0..=name_length - n)
                    .rev()
                    .find(|taken| fits[p + 1][n + taken])?,
            };
            captures.push(Capture {
                tokens: name[n..n + taken]
                    .iter()
                    .map(|token| (*token).to_owned())
                    .collect(),
                is_from_the_root: p == 0
                    && self.begins_with_wildcard
                    && matches!(token, Token::Many),
            });
            n += taken;
        }
        Some(captures)
    }
}

/// What is wrong with one side of a rule.
#[derive(Debug, Error)]
pub(super) enum PatternError {
    #[error(transparent)]
    Name(#[from] NameError),
    #[error(
        "`{0}` mixes a wildcard with letters; `*` and `**` stand for whole parts between slashes"
    )]
    PartialWildcard(String),
    #[error("has more than {WILDCARDS_MAX} wildcards")]
    Wildcards,
    #[error("`\\{reference}` refers to a wildcard, but there are {wildcards} on the other side")]
    Reference { reference: char, wildcards: usize },
    #[error("`{0}` mixes a reference with letters; `\\1` to `\\9` stand alone between slashes")]
    PartialReference(String),
    #[error("the new name takes no wildcard; write `\\1` for what the first one stood for")]
    WildcardInReplacement,
}

/// The new name, with what the wildcards stood for put in.
fn replace(
    replacement: &str,
    captures: &[Capture],
    node: &NodeIdentity,
) -> Result<String, PatternError> {
    if replacement.contains('*') {
        return Err(PatternError::WildcardInReplacement);
    }
    let mut result = Vec::new();
    let text = names::substitute(replacement, node)?;
    let mut begins_at_the_root = false;
    for (index, token) in text.split('/').enumerate() {
        let Some(reference) = token.strip_prefix('\\') else {
            if token.contains('\\') {
                return Err(PatternError::PartialReference(token.to_owned()));
            }
            result.push(token);
            continue;
        };
        let mut characters = reference.chars();
        let (Some(digit @ '1'..='9'), None) = (characters.next(), characters.next()) else {
            return Err(PatternError::PartialReference(token.to_owned()));
        };
        let capture = digit
            .to_digit(10)
            .and_then(|number| captures.get(number as usize - 1))
            .ok_or(PatternError::Reference {
                reference: digit,
                wildcards: captures.len(),
            })?;
        begins_at_the_root |= index == 0 && capture.is_from_the_root;
        result.extend(capture.tokens.iter().map(String::as_str));
    }
    let mut name = result.join("/");
    if begins_at_the_root {
        name.insert(0, '/');
    }
    // A reference to nothing leaves nothing between two slashes, or behind the last.
    if text.contains('\\') {
        while name.contains("//") {
            name = name.replace("//", "/");
        }
        name.truncate(name.trim_end_matches('/').len());
    }
    let name = names::absolute(&name, node)?;
    names::validate(&name)?;
    Ok(name)
}
