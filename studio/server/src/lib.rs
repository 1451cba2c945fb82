//! The page of `formation studio`, on loopback.
//!
//! A page, the engine behind it, and one run at a time, which is a child process: `formation run --control`. Whoever asks has to
//! know the token in the address, and to ask from this page: [`guard`] refuses every other host, origin and token before
//! anything else is read. *Invariant*: what a page sends is a scenario, validated as files are, or one of the fixed orders.

mod guard;
mod page;
mod routes;
mod run;

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use thiserror::Error;
use tiny_http::{Request, Response, Server};

use guard::Guard;
use routes::Routes;

/// How many requests are answered at once, those that listen to events included.
const REQUESTS_MAX: usize = 32;
/// Between two looks at whether to end.
const LOOK: Duration = Duration::from_millis(200);

/// Why there is no studio.
#[derive(Debug, Error)]
pub enum StudioError {
    /// The port is taken, or may not be used.
    #[error("cannot listen on 127.0.0.1:{port}: {reason}")]
    Port {
        /// The port.
        port: u16,
        /// What the system says.
        reason: String,
    },
    /// The system gives no random numbers for the token.
    #[error("cannot draw a token: {0}")]
    Token(getrandom::Error),
    /// A thread cannot be started, or a file not be written.
    #[error("the studio cannot go on: {0}")]
    System(#[from] io::Error),
}

/// What a studio does besides drawing and planning.
pub enum Work {
    /// It starts runs. The command begins a run that takes orders; the path of a scenario file is added to it.
    Runs {
        /// Makes the command.
        command: Box<dyn Fn() -> Command + Send + Sync>,
        /// Where scenario files of runs are written.
        folder: PathBuf,
    },
    /// It shows what a command prints, as a run does, and takes no orders.
    Watches {
        /// Makes the command.
        command: Box<dyn Fn() -> Command + Send + Sync>,
    },
}

/// A studio that listens.
pub struct Studio {
    server: Server,
    routes: Arc<Routes>,
    address: String,
}

impl Studio {
    /// Listens on loopback, on any free port if it is 0. `scenario` is the text with which the page begins.
    ///
    /// # Errors
    /// The port is taken, or there are no random numbers.
    pub fn listen(port: u16, work: Work, scenario: Option<String>) -> Result<Self, StudioError> {
        let server = Server::http(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
        let server = server.map_err(|error| StudioError::Port {
            port,
            reason: error.to_string(),
        })?;
        let port = server.server_addr().to_ip().map_or(port, |it| it.port());
        let guard = Guard::new(port).map_err(StudioError::Token)?;
        let address = guard.address();
        Ok(Self {
            server,
            routes: Arc::new(Routes::new(guard, work, scenario)?),
            address,
        })
    }

    /// The address of the page, with its token.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Answers requests until it is told to end; then ends the run.
    ///
    /// # Errors
    /// The socket fails.
    pub fn serve(&self, end: &AtomicBool) -> Result<(), StudioError> {
        let working = Arc::new(AtomicUsize::new(0));
        while !end.load(Ordering::Relaxed) {
            let Some(request) = self.server.recv_timeout(LOOK)? else {
                continue;
            };
            if working.load(Ordering::Relaxed) >= REQUESTS_MAX {
                refuse(request);
                continue;
            }
            working.fetch_add(1, Ordering::Relaxed);
            let (routes, done) = (Arc::clone(&self.routes), Arc::clone(&working));
            thread::Builder::new()
                .name("request".to_owned())
                .spawn(move || {
                    routes.answer(request);
                    done.fetch_sub(1, Ordering::Relaxed);
                })?;
        }
        self.routes.end();
        Ok(())
    }
}

fn refuse(request: Request) {
    // Whoever asked may be gone.
    let _ =
        request.respond(Response::from_string("too many requests at once").with_status_code(503));
}
