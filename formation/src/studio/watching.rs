//! Watching a formation that runs elsewhere. Nothing is sent to it.

use std::process::{Child, Stdio};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::Context;
use ros_runtime::exit::Failure;

use super::{Studio, child, lock};

/// How long to wait before a formation is looked for again.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

/// What looks for formations until it is ended.
pub struct Watching {
    present: Arc<Mutex<Option<Arc<Mutex<Child>>>>>,
    stop: Sender<()>,
    thread: JoinHandle<()>,
}

impl Watching {
    /// Ends it, and its process.
    pub fn end(self) {
        drop(self.stop);
        let present = lock(&self.present).take();
        if let Some(present) = present {
            child::terminate(&present);
        }
        // It has nothing to say when it panicked.
        let _ = self.thread.join();
    }
}

/// Begins to look for a formation, and to watch it; then for the next.
///
/// # Errors
/// There can be no thread.
pub fn start(studio: &Arc<Studio>, session: Option<u32>) -> Result<Watching, Failure> {
    let present = Arc::new(Mutex::new(None));
    let (stop, stopped) = channel::<()>();
    let (studio, its_present) = (Arc::clone(studio), Arc::clone(&present));
    let watch = move || {
        loop {
            let mut command = studio.command("watch");
            command.arg("--events").stdin(Stdio::null());
            if let Some(session) = session {
                command.args(["--session", &session.to_string()]);
            }
            let text = "looks for a formation, and watches it";
            studio.course().begin(None, text);
            match child::spawn(&mut command) {
                Ok((child, lines)) => {
                    *lock(&its_present) = Some(Arc::clone(&child));
                    let end = child::follow(&studio, &lines, &child, &Arc::default());
                    lock(&its_present).take();
                    studio.course().end(&end);
                }
                Err(error) => studio.course().end(&format!("cannot watch: {error}")),
            }
            if stopped.recv_timeout(LOOK_AGAIN) != Err(RecvTimeoutError::Timeout) {
                return;
            }
        }
    };
    let thread = thread::Builder::new().name("watch".to_owned()).spawn(watch);
    let thread = thread
        .context("cannot start a thread that watches")
        .map_err(Failure::Failed)?;
    Ok(Watching {
        present,
        stop,
        thread,
    })
}
