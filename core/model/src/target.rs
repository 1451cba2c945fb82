//! The target configuration: a validated graph of spots, connected unless it says that it is in parts.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::field_error::{check_id, checked_pose, connected_graph, simple_graph};
use crate::{
    EDGES_MAX, FieldError, GivenAllocation, MicroUnits, Pose, RawGiven, SPOTS_MAX, Spot, SpotId,
    Surroundings, Topology,
};

/// A spot or a module as it stands in a file or a message, not yet checked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "an identifier with a position")]
pub struct RawPlacement {
    /// The identifier.
    pub id: u32,
    /// Position in units.
    pub x: f64,
    /// Position in units.
    pub y: f64,
    /// Heading in radians.
    #[serde(default)]
    pub theta: f64,
}

/// A spot, not yet checked.
pub type RawSpot = RawPlacement;

/// A module, not yet checked.
pub type RawModule = RawPlacement;

/// A target as it stands in a file or a message, not yet checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTarget {
    /// The frame of all poses (REP-105), such as `map`.
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

/// A validated target: at least one spot, distinct identifiers, a simple graph. It is connected, except what [`Target::in_parts`] makes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    frame_id: String,
    spots: Vec<Spot>,
    topology: Topology,
    surroundings: Surroundings,
    given: Option<Arc<GivenAllocation>>,
}

impl TryFrom<RawTarget> for Target {
    type Error = FieldError;

    fn try_from(raw: RawTarget) -> Result<Self, FieldError> {
        Self::made(raw, |ids, edges| {
            connected_graph(ids, edges, SpotId, "the target")
        })
    }
}

impl Target {
    /// A target that may be in several parts. Modules cannot dock into one formation there, so it is planned and checked only.
    ///
    /// # Errors
    /// Names the field that is wrong.
    pub fn in_parts(raw: RawTarget) -> Result<Self, FieldError> {
        Self::made(raw, |ids, edges| {
            simple_graph(ids, edges, SpotId, "the target")
        })
    }

    fn made(
        raw: RawTarget,
        graph: impl FnOnce(&[u32], &[[u32; 2]]) -> Result<Topology, FieldError>,
    ) -> Result<Self, FieldError> {
        for (field, count, limit) in [
            ("spots", raw.spots.len(), SPOTS_MAX),
            ("edges", raw.edges.len(), EDGES_MAX),
        ] {
            if count > limit {
                let reason = format!("{count} entries; at most {limit} are supported");
                return Err(FieldError::new(field, reason));
            }
        }
        if raw.spots.is_empty() {
            return Err(FieldError::new(
                "spots",
                "the target needs at least one spot",
            ));
        }
        let mut numbered = Vec::with_capacity(raw.spots.len());
        for (index, spot) in raw.spots.iter().enumerate() {
            let id = SpotId(spot.id);
            let field = format!("spots[{index}]");
            check_id(format_args!("{field}.id"), spot.id)?;
            let pose = checked_pose(field, id, (spot.x, spot.y, spot.theta))?;
            numbered.push((Spot { id, pose }, index));
        }
        numbered.sort_by_key(|(spot, index)| (spot.id, *index));
        if let Some(pair) = numbered
            .windows(2)
            .find(|pair| pair[0].0.id == pair[1].0.id)
        {
            let (spot, index) = pair[1];
            let reason = format!("{} is used twice", spot.id);
            return Err(FieldError::new(format_args!("spots[{index}].id"), reason));
        }
        let spots: Vec<Spot> = numbered.into_iter().map(|(spot, _)| spot).collect();
        let ids: Vec<u32> = spots.iter().map(|spot| spot.id.0).collect();
        Ok(Self {
            topology: graph(&ids, &raw.edges)?,
            frame_id: raw.frame_id,
            spots,
            surroundings: Surroundings::default(),
            given: None,
        })
    }

    /// The same target in other surroundings.
    ///
    /// # Errors
    /// Names the spot that lies on an obstacle or beyond the walls.
    pub fn within(self, surroundings: Surroundings) -> Result<Self, FieldError> {
        surroundings.check_spots(&self.spots)?;
        Ok(Self {
            surroundings,
            ..self
        })
    }

    /// The same target, of which it is given who takes which spot.
    ///
    /// # Errors
    /// Names the entry that repeats a module or a spot, or names a spot that there is not.
    pub fn with_given(self, raw: &RawGiven) -> Result<Self, FieldError> {
        let given = GivenAllocation::new(raw, |spot| self.position_of(spot).is_some())?;
        Ok(Self {
            given: Some(Arc::new(given)),
            ..self
        })
    }

    /// The same target without such a table.
    #[must_use]
    pub fn without_given(self) -> Self {
        Self {
            given: None,
            ..self
        }
    }

    /// Who takes which spot, under the policy `given`.
    pub fn given(&self) -> Option<&GivenAllocation> {
        self.given.as_deref()
    }

    /// The bodies of its modules, and where they move.
    pub fn surroundings(&self) -> &Surroundings {
        &self.surroundings
    }

    /// The frame of all poses.
    pub fn frame_id(&self) -> &str {
        &self.frame_id
    }

    /// The spots in ascending order of identifier; a spot's position in this list is its node in
    /// [`Self::topology`].
    pub fn spots(&self) -> &[Spot] {
        &self.spots
    }

    /// The graph of adjacent spots.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// The position of a spot in [`Self::spots`].
    pub fn position_of(&self, id: SpotId) -> Option<usize> {
        self.spots.binary_search_by_key(&id, |spot| spot.id).ok()
    }

    /// The spot of that identifier.
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

    /// The mean of the spots' positions, rounded towards zero, with heading zero. Units take turns by their distance from it
    /// (paper, section "Planning Phase").
    pub fn centre(&self) -> Pose {
        let mean = |coordinate: &dyn Fn(&Pose) -> MicroUnits| {
            let spots = self.spots.iter();
            let sum: i128 = spots.map(|spot| i128::from(coordinate(&spot.pose).0)).sum();
            // A target has at least one spot, and a mean lies between the coordinates.
            let mean = sum / self.spots.len().max(1) as i128;
            MicroUnits(i64::try_from(mean).unwrap_or_default())
        };
        Pose {
            x: mean(&|pose| pose.x),
            y: mean(&|pose| pose.y),
            theta: MicroUnits::ZERO,
        }
    }

    /// The part of this target on the spots at `positions` (ascending, distinct); `None` if it is empty or disconnected.
    pub fn restricted_to(&self, positions: &[usize]) -> Option<Self> {
        let topology = self.topology.induced_by(positions);
        let spots = positions.iter().map(|&position| self.spots[position]);
        (topology.components().len() == 1).then(|| Self {
            frame_id: self.frame_id.clone(),
            spots: spots.collect(),
            topology,
            surroundings: self.surroundings.clone(),
            given: self.given.clone(),
        })
    }

    /// The target as it stands in files and messages.
    pub fn to_raw(&self) -> RawTarget {
        let spots = self.spots.iter().map(|&Spot { id, pose }| RawSpot {
            id: id.0,
            x: pose.x.to_units(),
            y: pose.y.to_units(),
            theta: pose.theta.to_units(),
        });
        let edges = self.topology.edges().iter();
        RawTarget {
            frame_id: self.frame_id.clone(),
            spots: spots.collect(),
            edges: edges
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
    fn a_target_survives_conversion_to_raw_and_back() {
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
            "spots: the target needs at least one spot"
        );
        assert_eq!(refusal(&[1, 1], &[]), "spots[1].id: spot 1 is used twice");
        assert_eq!(
            refusal(&[1], &[[1, 9]]),
            "edges[0]: spot 9 is not in the target"
        );
        assert_eq!(refusal(&[1], &[[1, 1]]), "edges[0]: joins spot 1 to itself");
        assert_eq!(
            refusal(&[1, 2], &[[1, 2], [2, 1]]),
            "edges[1]: spot 1 and spot 2 are joined twice"
        );
        assert_eq!(
            refusal(&[1, 2, 3], &[[1, 2]]),
            "edges: the target is disconnected; spot 3 cannot be reached from spot 1"
        );
        let mut bad = raw(&[1, 2], &[[1, 2]]);
        bad.spots[1].x = f64::INFINITY;
        assert_eq!(
            Target::try_from(bad).unwrap_err().to_string(),
            "spots[1].x: must be a finite number, got inf (spot 2)"
        );
    }

    #[test]
    fn a_target_in_parts_is_checked_like_any_other() {
        let parts = Target::in_parts(raw(&[1, 2, 3], &[[1, 2]])).unwrap();
        assert_eq!(parts.topology().components(), [vec![0, 1], vec![2]]);
        let twice = Target::in_parts(raw(&[1, 1], &[])).unwrap_err();
        assert_eq!(twice.to_string(), "spots[1].id: spot 1 is used twice");
        let unknown = Target::in_parts(raw(&[1], &[[1, 9]])).unwrap_err();
        assert_eq!(unknown.to_string(), "edges[0]: spot 9 is not in the target");
    }
}
