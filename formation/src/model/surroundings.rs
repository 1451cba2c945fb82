//! What a target's modules are and where they move: the width of their bodies.

use std::fmt;

use crate::model::{FieldError, MicroUnits};

/// The width of a body in units, unless a scenario gives another.
pub const BODY_WIDTH: MicroUnits = MicroUnits(900_000);

/// The least width of a body.
const BODY_WIDTH_MIN: MicroUnits = MicroUnits(100_000);

/// The surroundings of a target as they stand in a file or a message, in units, not yet checked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawSurroundings {
    /// The width of a body; `None` for [`BODY_WIDTH`].
    pub body_width: Option<f64>,
}

/// Validated surroundings of a target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Surroundings {
    body_width: MicroUnits,
}

impl Default for Surroundings {
    fn default() -> Self {
        Self {
            body_width: BODY_WIDTH,
        }
    }
}

impl TryFrom<RawSurroundings> for Surroundings {
    type Error = FieldError;

    fn try_from(raw: RawSurroundings) -> Result<Self, FieldError> {
        let refused = |reason: &dyn fmt::Display| FieldError::new("body_width", reason);
        let body_width = raw.body_width.map(MicroUnits::from_units).transpose();
        let body_width = body_width.map_err(|error| refused(&error))?;
        let body_width = body_width.unwrap_or(BODY_WIDTH);
        if !(BODY_WIDTH_MIN..=MicroUnits::ONE).contains(&body_width) {
            let (least, given) = (BODY_WIDTH_MIN.to_units(), body_width.to_units());
            let pitch = "1, the pitch of the lattice";
            return Err(refused(&format_args!(
                "must lie between {least} units and {pitch}, got {given}"
            )));
        }
        Ok(Self { body_width })
    }
}

impl Surroundings {
    /// The width of the square body of a module. Bodies must not overlap; the rest of a cell is what drives may be off.
    #[must_use]
    pub fn body_width(&self) -> MicroUnits {
        self.body_width
    }

    /// The surroundings as they stand in files and messages.
    #[must_use]
    pub fn to_raw(&self) -> RawSurroundings {
        RawSurroundings {
            body_width: Some(self.body_width.to_units()),
        }
    }
}
