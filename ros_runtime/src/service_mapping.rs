//! How a reply names its request on the wire, in which the vendors of ROS 2 differ.

use crate::middleware::RMW_ZENOH;
use crate::words::{Words, by_words};

/// The variable that decides the mapping unless an argument does.
pub const RMW_IMPLEMENTATION: &str = "RMW_IMPLEMENTATION";

/// How a reply names the request that it answers. Both ends must use the same mapping, or calls are never answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ServiceMapping {
    /// In a header before the data, as CycloneDDS does.
    Cyclone,
    /// Next to the data, as the standard "RPC over DDS" has it and Fast DDS and Connext do.
    #[default]
    Enhanced,
}

impl ServiceMapping {
    /// The mapping of the named middleware; that of Fast DDS, the default of ROS 2, if none is named.
    ///
    /// # Errors
    /// Says why nodes on that middleware could not call this one.
    pub fn of_middleware(name: Option<&str>) -> Result<Self, String> {
        match name.map(str::trim) {
            None
            | Some("" | "rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" | "rmw_connextdds") => {
                Ok(Self::Enhanced)
            }
            Some("rmw_cyclonedds_cpp") => Ok(Self::Cyclone),
            // An argument chose DDS instead.
            Some(RMW_ZENOH) => Ok(Self::Enhanced),
            Some(other) => Err(format!(
                "`{other}` is none of rmw_fastrtps_cpp, rmw_fastrtps_dynamic_cpp, rmw_connextdds, rmw_cyclonedds_cpp and \
                 rmw_zenoh_cpp; unset it, or choose a mapping with --service-mapping"
            )),
        }
    }

    pub(crate) fn library(self) -> ros2_client::ServiceMapping {
        match self {
            Self::Cyclone => ros2_client::ServiceMapping::Cyclone,
            Self::Enhanced => ros2_client::ServiceMapping::Enhanced,
        }
    }
}

impl Words for ServiceMapping {
    const WORDS: &'static [(&'static str, Self)] =
        &[("cyclone", Self::Cyclone), ("enhanced", Self::Enhanced)];
}

by_words!(ServiceMapping);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mapping_is_that_of_the_middleware() {
        for (name, mapping) in [
            (None, ServiceMapping::Enhanced),
            (Some(""), ServiceMapping::Enhanced),
            (Some("rmw_fastrtps_cpp"), ServiceMapping::Enhanced),
            (Some("rmw_cyclonedds_cpp"), ServiceMapping::Cyclone),
        ] {
            assert_eq!(ServiceMapping::of_middleware(name), Ok(mapping));
        }
        let error = ServiceMapping::of_middleware(Some("rmw_other_cpp")).unwrap_err();
        assert!(error.contains("--service-mapping"), "{error}");
        assert_eq!("Cyclone".parse(), Ok(ServiceMapping::Cyclone));
        assert!("basic".parse::<ServiceMapping>().is_err());
    }
}
