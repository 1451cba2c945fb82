//! A Zenoh router in this process.

use zenoh::{Session, Wait};

pub use super::refusals::log as log_refusals;
use super::{configuration, failed, protection};
use crate::ros_context_error::RosContextError;
use crate::security::Security;

/// A router, which routes between all processes that connect to it until it is stopped or dropped.
pub struct Router {
    session: Session,
    listening: String,
}

impl Router {
    /// Starts to route. Endpoints are like `tcp/127.0.0.1:7447`; without any, the router listens where its configuration
    /// says, and connects to no other router.
    ///
    /// # Errors
    /// An endpoint or the configuration cannot be used, or security is demanded and the configuration lacks it.
    pub fn start(listen: &[String], connect: &[String]) -> Result<Self, RosContextError> {
        let given = [("listen/endpoints", listen), ("connect/endpoints", connect)]
            .into_iter()
            .filter(|(_, given)| !given.is_empty())
            .map(|(key, given)| (key, format!("{given:?}")));
        let variable = |name: &str| std::env::var(name).ok();
        let config = configuration::of_router(&given.collect::<Vec<_>>(), variable)
            .map_err(RosContextError::BadInput)?;
        let security = Security::resolve(variable).map_err(RosContextError::BadInput)?;
        protection::check_router(security, &config)?;
        let listening = config.get_json("listen/endpoints").unwrap_or_default();
        let session = zenoh::open(config)
            .wait()
            .map_err(|error| failed("start a router", &error))?;
        Ok(Self { session, listening })
    }

    /// Where it listens.
    #[must_use]
    pub fn listening(&self) -> &str {
        &self.listening
    }

    /// Stops to route.
    ///
    /// # Errors
    /// Says why the links could not be closed.
    pub fn stop(self) -> Result<(), RosContextError> {
        self.session
            .close()
            .wait()
            .map_err(|error| failed("stop the router", &error))
    }
}
