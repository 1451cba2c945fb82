//! The target configuration: a validated, connected graph of spots.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::model::{
    EDGES_MAX, NO_ID, Pose, PoseError, SPOTS_MAX, SpotId, Topology, TopologyError, centre_of,
};

/// A spot as it stands in a file or a message, not yet checked. Units and radians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSpot {
    /// The spot's identifier.
    pub id: u32,
    /// Position in units.
    pub x: f64,
    /// Position in units.
    pub y: f64,
    /// Heading in radians.
    #[serde(default)]
    pub theta: f64,
}

/// A target as it stands in a file or a message, not yet checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTarget {
    /// The frame in which all poses are given (REP-105), such as `map`.
    #[serde(default = "default_frame")]
    pub frame_id: String,
    /// The spots.
    pub spots: Vec<RawSpot>,
    /// Pairs of adjacent spots.
    #[serde(default)]
    pub edges: Vec<[u32; 2]>,
}

fn default_frame() -> String {
    "map".to_owned()
}

/// One place that a module is to occupy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Spot {
    /// The spot's identifier.
    pub id: SpotId,
    /// Where the module on it stands.
    pub pose: Pose,
}

/// A validated target: at least one spot, distinct identifiers, a connected simple graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    frame_id: String,
    spots: Vec<Spot>,
    topology: Topology,
}

/// Why a target was refused; each message begins with the field that is wrong.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TargetError {
    /// There is no spot at all.
    #[error("spots: the target is empty; it needs at least one spot")]
    Empty,
    /// There are more spots or edges than the suite takes.
    #[error("{field}: {count} entries, at most {limit} are supported")]
    TooLarge {
        /// `spots` or `edges`.
        field: &'static str,
        /// How many were given.
        count: usize,
        /// How many are taken.
        limit: usize,
    },
    /// A spot carries the identifier reserved for "none".
    #[error("spots[{index}].id: {NO_ID} is reserved and cannot be used")]
    ReservedId {
        /// The position in the list.
        index: usize,
    },
    /// Two spots carry the same identifier.
    #[error("spots[{index}].id: {id} is used twice")]
    DuplicateSpot {
        /// The position of the second one in the list.
        index: usize,
        /// The identifier.
        id: SpotId,
    },
    /// A coordinate cannot be used.
    #[error("spots[{index}].{source} ({id})")]
    Pose {
        /// The position in the list.
        index: usize,
        /// The spot.
        id: SpotId,
        /// The coordinate and what is wrong with it.
        #[source]
        source: PoseError,
    },
    /// An edge names a spot that is not in the list.
    #[error("edges[{index}]: there is no {id}")]
    NoSuchSpot {
        /// The position in the list.
        index: usize,
        /// The identifier that is missing.
        id: SpotId,
    },
    /// An edge joins a spot to itself.
    #[error("edges[{index}]: joins {id} to itself")]
    SelfLoop {
        /// The position in the list.
        index: usize,
        /// The spot.
        id: SpotId,
    },
    /// An edge is listed twice.
    #[error("edges: {0} and {1} are joined twice")]
    DuplicateEdge(SpotId, SpotId),
    /// Some spot cannot be reached from the first one.
    #[error("edges: the target is disconnected; {unreached} cannot be reached from {from}")]
    Disconnected {
        /// The spot with the lowest identifier.
        from: SpotId,
        /// The lowest spot that cannot be reached from it.
        unreached: SpotId,
    },
}

impl TryFrom<RawTarget> for Target {
    type Error = TargetError;

    fn try_from(raw: RawTarget) -> Result<Self, TargetError> {
        for (field, count, limit) in [
            ("spots", raw.spots.len(), SPOTS_MAX),
            ("edges", raw.edges.len(), EDGES_MAX),
        ] {
            if count > limit {
                return Err(TargetError::TooLarge {
                    field,
                    count,
                    limit,
                });
            }
        }
        let mut numbered = Vec::with_capacity(raw.spots.len());
        for (index, spot) in raw.spots.iter().enumerate() {
            let id = SpotId(spot.id);
            if spot.id == NO_ID {
                return Err(TargetError::ReservedId { index });
            }
            let pose = Pose::from_units(spot.x, spot.y, spot.theta)
                .map_err(|source| TargetError::Pose { index, id, source })?;
            numbered.push((Spot { id, pose }, index));
        }
        numbered.sort_by_key(|(spot, index)| (spot.id, *index));
        if let Some(pair) = numbered
            .windows(2)
            .find(|pair| pair[0].0.id == pair[1].0.id)
        {
            let (spot, index) = pair[1];
            return Err(TargetError::DuplicateSpot { index, id: spot.id });
        }
        let spots: Vec<Spot> = numbered.into_iter().map(|(spot, _)| spot).collect();
        let position = |index: usize, id: u32| {
            spots
                .binary_search_by_key(&SpotId(id), |spot| spot.id)
                .map_err(|_| TargetError::NoSuchSpot {
                    index,
                    id: SpotId(id),
                })
        };
        let mut edges = Vec::with_capacity(raw.edges.len());
        for (index, &[first, second]) in raw.edges.iter().enumerate() {
            let edge = (position(index, first)?, position(index, second)?);
            if first == second {
                return Err(TargetError::SelfLoop {
                    index,
                    id: SpotId(first),
                });
            }
            edges.push(edge);
        }
        Self::from_parts(raw.frame_id, spots, &edges)
    }
}

impl Target {
    /// Builds a target from spots in ascending order of identifier and edges between their positions.
    fn from_parts(
        frame_id: String,
        spots: Vec<Spot>,
        edges: &[(usize, usize)],
    ) -> Result<Self, TargetError> {
        let Some(first) = spots.first() else {
            return Err(TargetError::Empty);
        };
        let topology = Topology::new(spots.len(), edges).map_err(|error| match error {
            TopologyError::Duplicate(one, other) => {
                TargetError::DuplicateEdge(spots[one].id, spots[other].id)
            }
            TopologyError::SelfLoop(index) | TopologyError::NoSuchNode(index, _) => {
                TargetError::SelfLoop {
                    index,
                    id: first.id,
                }
            }
        })?;
        let components = topology.components_within(|_| true);
        if let Some(unreached) = components.get(1).and_then(|component| component.first()) {
            return Err(TargetError::Disconnected {
                from: first.id,
                unreached: spots[*unreached].id,
            });
        }
        Ok(Self {
            frame_id,
            spots,
            topology,
        })
    }

    /// The frame in which all poses are given.
    #[must_use]
    pub fn frame_id(&self) -> &str {
        &self.frame_id
    }

    /// The spots in ascending order of identifier; a spot's position in this list is its node in
    /// [`Self::topology`].
    #[must_use]
    pub fn spots(&self) -> &[Spot] {
        &self.spots
    }

    /// Which spots are adjacent.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// The position of a spot in [`Self::spots`].
    #[must_use]
    pub fn position_of(&self, id: SpotId) -> Option<usize> {
        self.spots.binary_search_by_key(&id, |spot| spot.id).ok()
    }

    /// The spot of that identifier.
    #[must_use]
    pub fn spot(&self, id: SpotId) -> Option<&Spot> {
        self.position_of(id).map(|position| &self.spots[position])
    }

    /// The spots adjacent to one, in ascending order; empty for an unknown spot.
    pub fn neighbours_of(&self, id: SpotId) -> impl Iterator<Item = SpotId> + '_ {
        self.position_of(id)
            .map_or(&[][..], |position| self.topology.neighbours(position))
            .iter()
            .map(|&neighbour| self.spots[neighbour].id)
    }

    /// The mean of the spots' positions, the point by whose distance units take their turns.
    #[must_use]
    pub fn centre(&self) -> Pose {
        centre_of(self.spots.iter().map(|spot| &spot.pose))
    }

    /// The part of this target on the spots at `positions` (ascending, distinct).
    ///
    /// # Errors
    /// Refuses an empty or disconnected part.
    pub fn restricted_to(&self, positions: &[usize]) -> Result<Self, TargetError> {
        let spots = positions
            .iter()
            .map(|&position| self.spots[position])
            .collect();
        Self::from_parts(
            self.frame_id.clone(),
            spots,
            self.topology.induced_by(positions).edges(),
        )
    }

    /// The target as it stands in files and messages.
    #[must_use]
    pub fn to_raw(&self) -> RawTarget {
        RawTarget {
            frame_id: self.frame_id.clone(),
            spots: self
                .spots
                .iter()
                .map(|spot| RawSpot {
                    id: spot.id.0,
                    x: spot.pose.x.to_units(),
                    y: spot.pose.y.to_units(),
                    theta: spot.pose.theta.to_units(),
                })
                .collect(),
            edges: self
                .topology
                .edges()
                .iter()
                .map(|&(first, second)| [self.spots[first].id.0, self.spots[second].id.0])
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(ids: &[u32], edges: &[[u32; 2]]) -> RawTarget {
        RawTarget {
            frame_id: "map".to_owned(),
            spots: ids
                .iter()
                .map(|&id| RawSpot {
                    id,
                    x: f64::from(id),
                    y: 0.0,
                    theta: 0.0,
                })
                .collect(),
            edges: edges.to_vec(),
        }
    }

    #[test]
    fn a_target_survives_the_way_out_and_in() {
        let target = Target::try_from(raw(&[3, 1, 2], &[[1, 2], [3, 2]])).unwrap();
        assert_eq!(target.spots()[0].id, SpotId(1));
        assert_eq!(Target::try_from(target.to_raw()).unwrap(), target);
        assert_eq!(
            target.neighbours_of(SpotId(2)).collect::<Vec<_>>(),
            [SpotId(1), SpotId(3)]
        );
    }

    #[test]
    fn each_fault_is_named() {
        let refusal = |ids: &[u32], edges: &[[u32; 2]]| {
            Target::try_from(raw(ids, edges)).unwrap_err().to_string()
        };
        assert_eq!(
            refusal(&[], &[]),
            "spots: the target is empty; it needs at least one spot"
        );
        assert_eq!(refusal(&[1, 1], &[]), "spots[1].id: spot 1 is used twice");
        assert_eq!(refusal(&[1], &[[1, 9]]), "edges[0]: there is no spot 9");
        assert_eq!(refusal(&[1], &[[1, 1]]), "edges[0]: joins spot 1 to itself");
        assert_eq!(
            refusal(&[1, 2], &[[1, 2], [2, 1]]),
            "edges: spot 1 and spot 2 are joined twice"
        );
        assert_eq!(
            refusal(&[1, 2, 3], &[[1, 2]]),
            "edges: the target is disconnected; spot 3 cannot be reached from spot 1"
        );
        let mut bad = raw(&[1, 2], &[[1, 2]]);
        bad.spots[1].x = f64::INFINITY;
        assert_eq!(
            Target::try_from(bad).unwrap_err().to_string(),
            "spots[1].x must be a finite number, got inf (spot 2)"
        );
    }
}
