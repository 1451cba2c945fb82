//! Services as values.

use std::marker::PhantomData;

use ros2_client::RmwRequestId;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Data that travels in a service or an action.
pub trait ServiceData: Serialize + DeserializeOwned + Clone + 'static {}

impl<T: Serialize + DeserializeOwned + Clone + 'static> ServiceData for T {}

/// A service or an action, in which data of the types in `T` travels.
#[derive(Debug)]
pub struct Served<T> {
    pub(crate) name: &'static str,
    package: &'static str,
    type_name: &'static str,
    types: PhantomData<T>,
}

/// A service that takes `Q` and answers `A`.
pub type DeclaredService<Q, A> = Served<fn(Q) -> A>;

impl<T> Served<T> {
    /// A service of type `package/srv/type_name`, or an action of type `package/action/type_name`, whose name is expanded
    /// and remapped like every name.
    #[must_use]
    pub const fn new(name: &'static str, package: &'static str, type_name: &'static str) -> Self {
        Self {
            name,
            package,
            type_name,
            types: PhantomData,
        }
    }

    /// The package of the type, and the type in it.
    pub(crate) fn type_name(&self) -> (&'static str, &'static str) {
        (self.package, self.type_name)
    }
}

/// Sends the answer to one request.
pub type Reply<A> = Box<dyn FnOnce(A)>;

/// A request and the means to answer it.
pub struct Call<Q, A> {
    /// What the client asks.
    pub request: Q,
    /// Sends the answer.
    pub reply: Reply<A>,
}

/// Which request a reply answers.
pub type RequestId = RmwRequestId;

/// Data on the wire, with the library's own trait, which types of other crates cannot have.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Carried<T>(pub T);

impl<T: Serialize + DeserializeOwned> ros2_client::Message for Carried<T> {}

/// How many requests of one service can wait to be answered.
pub(crate) const WAITING_MAX: usize = 16;
