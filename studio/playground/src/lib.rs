//! The engine of the studio as WebAssembly, for the page without a server.

use wasm_bindgen::prelude::wasm_bindgen;

/// Answers a request of the page, JSON by JSON; see [`formation_studio_engine::answer`].
#[wasm_bindgen]
#[must_use]
pub fn answer(request: &str) -> String {
    formation_studio_engine::answer(request)
}
