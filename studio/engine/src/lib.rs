//! What the browser page asks of the core: one request of JSON in, one answer of JSON out.
//!
//! A drawing is a scenario as JSON, which is YAML too, so what people draw is validated like what they write. *Invariant*: no
//! input makes [`answer`] panic, and each takes bounded time; the answer to an input that is refused says why.

mod answers;
mod findings;
mod request;
mod scenarios;

pub use request::{EngineRequest, SCENARIO_BYTES_MAX};

use serde::Serialize;
use serde_json::{Value, json};

/// Why a request has no answer.
#[derive(Clone, Debug, Serialize)]
pub struct Refusal {
    /// What is wrong, in words.
    pub text: String,
    /// Where it is wrong, as far as it is known.
    #[serde(flatten)]
    pub place: findings::Named,
}

/// Answers a request: `{"ok": ...}` or `{"error": {"text": ..., ...}}`.
#[must_use]
pub fn answer(request: &str) -> String {
    let answered = EngineRequest::read(request).and_then(|request| answers::of(&request));
    let answer: Value = match answered {
        Ok(answer) => json!({ "ok": answer }),
        Err(refusal) => json!({ "error": refusal }),
    };
    answer.to_string()
}
