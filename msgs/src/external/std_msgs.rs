//! Colours. The header, of which ours are made too, is [`crate::Header`].

use serde::{Deserialize, Serialize};

/// A colour; each part lies within 0 and 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct ColorRGBA {
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}

interface_types!("std_msgs": ColorRGBA);
