//! Checks of raw input that several validated types share, and the error that names the wrong field.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use thiserror::Error;

use crate::{NO_ID, Pose, Topology};

/// A field of raw input that was refused, and why.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{field}: {reason}")]
pub struct FieldError {
    /// The path of the field, such as `configurations[0].modules[2].id`.
    pub field: String,
    /// What is wrong with it.
    pub reason: String,
}

impl FieldError {
    pub(crate) fn new(field: impl fmt::Display, reason: impl fmt::Display) -> Self {
        Self {
            field: field.to_string(),
            reason: reason.to_string(),
        }
    }

    /// Prefixes the field with `whole`, of which it is a part.
    pub(crate) fn within(self, whole: &str) -> Self {
        Self::new(format_args!("{whole}.{}", self.field), self.reason)
    }
}

/// Refuses the identifier that is reserved for "none"; `field` is the path of the identifier.
pub(crate) fn check_id(field: impl fmt::Display, id: u32) -> Result<(), FieldError> {
    if id == NO_ID {
        return Err(FieldError::new(field, format_args!("{NO_ID} is reserved")));
    }
    Ok(())
}

/// Quantises the pose of a thing with a name and the path `field`.
pub(crate) fn checked_pose(
    field: impl fmt::Display,
    name: impl fmt::Display,
    (x, y, theta): (f64, f64, f64),
) -> Result<Pose, FieldError> {
    Pose::from_units(x, y, theta).map_err(|error| {
        let field = format!("{field}.{}", error.coordinate);
        FieldError::new(field, format_args!("{} ({name})", error.source))
    })
}

/// Builds the graph of the nodes with these distinct identifiers from the field `edges`, a list of pairs of them.
///
/// `name` turns an identifier into words, and `whole` names the graph, both for messages.
///
/// # Errors
/// Refuses edges to unknown nodes, self loops, repeated edges, and a graph that is not connected.
pub(crate) fn connected_graph<N: fmt::Display>(
    ids: &[u32],
    edges: &[[u32; 2]],
    name: impl Fn(u32) -> N,
    whole: impl fmt::Display,
) -> Result<Topology, FieldError> {
    let topology = simple_graph(ids, edges, &name, &whole)?;
    if let [first, unreached, ..] = topology.components().as_slice() {
        let (from, unreached) = (name(ids[first[0]]), name(ids[unreached[0]]));
        let reason = format!("{whole} is disconnected; {unreached} cannot be reached from {from}");
        return Err(FieldError::new("edges", reason));
    }
    Ok(topology)
}

/// Like [`connected_graph`], but the graph may be in several parts.
///
/// # Errors
/// Refuses edges to unknown nodes, self loops, and repeated edges.
pub(crate) fn simple_graph<N: fmt::Display>(
    ids: &[u32],
    edges: &[[u32; 2]],
    name: impl Fn(u32) -> N,
    whole: impl fmt::Display,
) -> Result<Topology, FieldError> {
    let positions: BTreeMap<u32, usize> = (0..).zip(ids).map(|(at, &id)| (id, at)).collect();
    let mut distinct = BTreeSet::new();
    for (index, &[first, second]) in edges.iter().enumerate() {
        let refuse = |reason: String| FieldError::new(format_args!("edges[{index}]"), reason);
        let position = |id: u32| {
            let unknown = || refuse(format!("{} is not in {whole}", name(id)));
            positions.get(&id).copied().ok_or_else(unknown)
        };
        let (one, other) = (position(first)?, position(second)?);
        if one == other {
            return Err(refuse(format!("joins {} to itself", name(first))));
        }
        if !distinct.insert((one.min(other), one.max(other))) {
            let (low, high) = (name(first.min(second)), name(first.max(second)));
            return Err(refuse(format!("{low} and {high} are joined twice")));
        }
    }
    let edges: Vec<(usize, usize)> = distinct.into_iter().collect();
    Ok(Topology::new(ids.len(), &edges))
}
