//! What other packages' messages hold of `sensor_msgs`.

use serde::{Deserialize, Serialize};

use crate::standard::Header;

/// A compressed image.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct CompressedImage {
    pub header: Header,
    pub format: String,
    pub data: Vec<u8>,
}

interface_types!("sensor_msgs": CompressedImage);
