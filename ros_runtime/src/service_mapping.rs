//! How requests and replies are told apart on the wire, in which the vendors of ROS 2 differ.

use std::fmt;
use std::str::FromStr;

/// What the mapping follows unless an argument decides.
pub const RMW_IMPLEMENTATION: &str = "RMW_IMPLEMENTATION";

/// How a reply names the request that it answers. Both ends must do it alike, or calls are never answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ServiceMapping {
    /// In a header before the data, as CycloneDDS does.
    Cyclone,
    /// Beside the data, as the standard "RPC over DDS" has it and Fast DDS and Connext do.
    #[default]
    Enhanced,
}

impl ServiceMapping {
    /// What the named middleware speaks; Fast DDS, which ROS 2 has by default, if none is named.
    ///
    /// # Errors
    /// Says why nodes on that middleware could not call anything of ours.
    pub fn of_middleware(name: Option<&str>) -> Result<Self, String> {
        match name.map(str::trim) {
            None
            | Some("" | "rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" | "rmw_connextdds") => {
                Ok(Self::Enhanced)
            }
            Some("rmw_cyclonedds_cpp") => Ok(Self::Cyclone),
            Some(other) => Err(format!(
                "`{other}` is none of rmw_fastrtps_cpp, rmw_fastrtps_dynamic_cpp, rmw_connextdds and \
                 rmw_cyclonedds_cpp; unset it, or say with --service-mapping how services are to be mapped"
            )),
        }
    }

    /// The mapping in the library's terms.
    pub fn library(self) -> ros2_client::ServiceMapping {
        match self {
            Self::Cyclone => ros2_client::ServiceMapping::Cyclone,
            Self::Enhanced => ros2_client::ServiceMapping::Enhanced,
        }
    }
}

impl FromStr for ServiceMapping {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim().to_ascii_lowercase().as_str() {
            "cyclone" => Ok(Self::Cyclone),
            "enhanced" => Ok(Self::Enhanced),
            _ => Err(format!("must be cyclone or enhanced, got `{text}`")),
        }
    }
}

impl fmt::Display for ServiceMapping {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Cyclone => "cyclone",
            Self::Enhanced => "enhanced",
        })
    }
}

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
        let told = ServiceMapping::of_middleware(Some("rmw_zenoh_cpp")).unwrap_err();
        assert!(told.contains("--service-mapping"), "{told}");
        assert_eq!("Cyclone".parse(), Ok(ServiceMapping::Cyclone));
        assert!("basic".parse::<ServiceMapping>().is_err());
    }
}
