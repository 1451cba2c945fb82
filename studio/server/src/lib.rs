//! The web server of the studio: it serves the page on loopback, behind a token, and passes what the page asks for to a
//! [`Backend`]. It knows nothing of formations.

mod answers;
mod events;
mod gate;
mod page;
mod server;

pub use events::EventHub;
pub use server::{Server, ServerError};

/// A longer body of a request is refused; the longest scenario of 10,000 modules is shorter.
pub const REQUEST_BYTES_MAX: usize = 4 * 1024 * 1024;

/// What answers the page. The calls may take long; several come at the same time.
pub trait Backend: Send + Sync + 'static {
    /// Answers a call of the engine, JSON by JSON.
    fn engine(&self, request: &str) -> String;

    /// The present run as one JSON object.
    fn state(&self) -> String;

    /// Carries out what the page asks of the run, such as `run` or `run/kill`; `None` if there is no such order.
    fn order(&self, name: &str, body: &str) -> Option<String>;
}
