//! Judges a formation by the messages on its topics alone.
//!
//! The observer is a state machine without I/O. Messages can come in any order and more than once. Modules are judged by the
//! causal marks in their messages, since the order in which messages of different senders arrive proves nothing. A promise
//! counts as broken only if some message shows it, or if all messages were received and none shows that it was kept.

mod bodies;
mod breach;
mod causality;
mod claims;
mod end_state;
mod judgement;
mod observation;
mod parameters;
mod progress;
mod received;
mod record;
mod verdict;

#[cfg(test)]
mod tests;

pub use observation::Observer;
pub use parameters::ObserverParameters;
pub use verdict::{Agreement, CollisionRisk, Counts, Outcome, Progress, Timings, Verdict};
