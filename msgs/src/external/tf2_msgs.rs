//! Transforms between frames.

use serde::{Deserialize, Serialize};

use super::geometry_msgs::TransformStamped;

/// What travels on `/tf` and `/tf_static`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct TFMessage {
    pub transforms: Vec<TransformStamped>,
}

interface_types!("tf2_msgs": TFMessage);
