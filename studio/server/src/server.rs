//! The server itself.

use std::future::Future;
use std::io;
use std::net::Ipv4Addr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::to_bytes;
use axum::extract::{Request, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{Method, StatusCode};
use axum::response::sse::{KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use thiserror::Error;
use tokio::net::TcpListener;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;

use crate::answers::{content, guarded, json, refusal};
use crate::events::{self, EventHub};
use crate::gate::Gate;
use crate::{Backend, REQUEST_BYTES_MAX, page};

/// How many calls are answered at the same time; others wait.
const CALLS_MAX: usize = 4;
/// How many pages get events at the same time.
const PAGES_MAX: usize = 32;
/// How long what is being answered may go on when the server ends.
const END_GRACE: Duration = Duration::from_secs(1);

/// Why there is no server.
#[derive(Debug, Error)]
pub enum ServerError {
    /// The port is taken, or may not be used.
    #[error("cannot listen on port {port} of 127.0.0.1: {error}; --port 0 takes a free one")]
    Port {
        /// The port.
        port: u16,
        /// What the system says.
        error: io::Error,
    },
    /// The operating system gives no random number.
    #[error("cannot draw a token: {0}")]
    Token(getrandom::Error),
    /// It cannot be started, or has failed.
    #[error("the server failed: {0}")]
    Failed(#[from] io::Error),
}

/// A server that listens on loopback.
pub struct Server {
    runtime: Runtime,
    listener: TcpListener,
    port: u16,
    token: String,
}

struct Shared {
    gate: Gate,
    backend: Arc<dyn Backend>,
    hub: EventHub,
    calls: Semaphore,
}

impl Server {
    /// Listens on a port of 127.0.0.1, 0 for a free one, behind a token that is drawn at random.
    ///
    /// # Errors
    /// The port cannot be had, or there is no random number.
    pub fn listen(port: u16) -> Result<Self, ServerError> {
        let mut drawn = [0; 16];
        getrandom::fill(&mut drawn).map_err(ServerError::Token)?;
        let token = drawn.iter().map(|byte| format!("{byte:02x}")).collect();
        let mut runtime = Builder::new_current_thread();
        runtime.enable_io().enable_time();
        let runtime = runtime.max_blocking_threads(2 * CALLS_MAX).build()?;
        let listener = runtime
            .block_on(TcpListener::bind((Ipv4Addr::LOCALHOST, port)))
            .map_err(|error| ServerError::Port { port, error })?;
        let port = listener.local_addr()?.port();
        Ok(Self {
            runtime,
            listener,
            port,
            token,
        })
    }

    /// The address of the page. Whoever knows it may use the server.
    #[must_use]
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Answers requests until `stop`.
    ///
    /// # Errors
    /// The system does not let it go on.
    pub fn serve(
        self,
        backend: Arc<dyn Backend>,
        hub: EventHub,
        stop: impl Future<Output = ()>,
    ) -> Result<(), ServerError> {
        let shared = Arc::new(Shared {
            gate: Gate::new(self.token, self.port),
            backend,
            hub,
            calls: Semaphore::new(CALLS_MAX),
        });
        let router = Router::new().fallback(answer).with_state(shared);
        let outcome = self.runtime.block_on(async {
            let served = axum::serve(self.listener, router).into_future();
            tokio::select! {
                outcome = served => outcome,
                () = stop => Ok(()),
            }
        });
        self.runtime.shutdown_timeout(END_GRACE);
        Ok(outcome?)
    }
}

async fn answer(State(shared): State<Arc<Shared>>, request: Request) -> Response {
    let path = request.uri().path().to_owned();
    let response = match shared.gate.admit(&path, request.headers()) {
        Ok(rest) => route(&shared, rest, request).await,
        Err(StatusCode::FORBIDDEN) => refusal(
            StatusCode::FORBIDDEN,
            "only pages of this server may ask it, by the address that it printed",
        ),
        Err(status) => refusal(status, "there is no such page"),
    };
    guarded(response)
}

async fn route(shared: &Arc<Shared>, rest: &str, request: Request) -> Response {
    let Some(call) = rest.strip_prefix("api/") else {
        return match (request.method(), page::file(rest)) {
            (&Method::GET, Some((content_type, body))) => content(content_type, body),
            (&Method::GET, None) => refusal(StatusCode::NOT_FOUND, "there is no such page"),
            _ => refusal(StatusCode::METHOD_NOT_ALLOWED, "a page is asked for by GET"),
        };
    };
    match (request.method(), call) {
        (&Method::GET, "state") => json(shared.backend.state()),
        (&Method::GET, "events") => follow(shared),
        (&Method::POST, _) => {
            let call = call.to_owned();
            take_call(shared, call, request).await
        }
        _ => refusal(
            StatusCode::METHOD_NOT_ALLOWED,
            "GET has api/state and api/events, the rest is POST",
        ),
    }
}

fn follow(shared: &Shared) -> Response {
    if shared.hub.pages() >= PAGES_MAX {
        return refusal(StatusCode::TOO_MANY_REQUESTS, "too many pages are open");
    }
    // Subscribed before, so that nothing is lost between the two.
    let receiver = shared.hub.subscribe();
    let stream = events::stream(shared.backend.state(), receiver);
    Sse::new(stream)
        .keep_alive(KeepAlive::default())
        .into_response()
}

async fn take_call(shared: &Arc<Shared>, call: String, request: Request) -> Response {
    // A form of another page cannot have this type without asking first, which is never granted.
    let given = request.headers().get(CONTENT_TYPE);
    let given = given.and_then(|given| given.to_str().ok()).unwrap_or("");
    let kind = given.split(';').next().unwrap_or("").trim();
    if !kind.eq_ignore_ascii_case("application/json") {
        return refusal(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "the body must be application/json",
        );
    }
    let Ok(body) = to_bytes(request.into_body(), REQUEST_BYTES_MAX).await else {
        return refusal(
            StatusCode::PAYLOAD_TOO_LARGE,
            "the body is longer than 4 MiB, or ended early",
        );
    };
    let Ok(body) = String::from_utf8(body.into()) else {
        return refusal(StatusCode::BAD_REQUEST, "the body must be UTF-8");
    };
    let Ok(permit) = shared.calls.acquire().await else {
        return refusal(StatusCode::SERVICE_UNAVAILABLE, "the server ends");
    };
    let backend = Arc::clone(&shared.backend);
    let answered = spawn_blocking(move || match call.as_str() {
        "engine" => Some(backend.engine(&body)),
        order => backend.order(order, &body),
    });
    let answered = answered.await;
    drop(permit);
    match answered {
        Ok(Some(answer)) => json(answer),
        Ok(None) => refusal(StatusCode::NOT_FOUND, "there is no such call"),
        Err(_) => refusal(
            StatusCode::INTERNAL_SERVER_ERROR,
            "the call failed; the terminal of the server says why",
        ),
    }
}
