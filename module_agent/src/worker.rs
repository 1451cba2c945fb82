//! A thread for what takes long, so that heartbeats continue meanwhile.

use std::thread;

use async_channel::{Sender, bounded};
use futures::{Stream, StreamExt, stream};
use ros_runtime::ros_context::RosContextError;

/// Does one job after another. The thread ends with the last sender of jobs, or with the process.
/// Enforces T5.
pub(crate) struct Worker<J> {
    jobs: Sender<J>,
}

impl<J: Send + 'static> Worker<J> {
    /// Starts the thread, of this name. The stream yields the results, and `None` if the thread has ended with jobs left.
    ///
    /// # Errors
    /// The machine has no thread left.
    pub(crate) fn start<R: Send + 'static, F: Fn(J) -> R + Send + 'static>(
        name: &str,
        work: F,
    ) -> Result<(Self, impl Stream<Item = Option<R>> + use<J, R, F>), RosContextError> {
        let (jobs, received) = bounded(1);
        let (sender, results) = bounded(1);
        let work_off = move || {
            while let Ok(job) = received.recv_blocking() {
                if sender.send_blocking(work(job)).is_err() {
                    return;
                }
            }
        };
        thread::Builder::new()
            .name(name.to_owned())
            .spawn(work_off)
            .map_err(|error| {
                RosContextError::Failed(format!("no thread for {name} can be started: {error}"))
            })?;
        let results = results.map(Some).chain(stream::iter([None]));
        Ok((Self { jobs }, results))
    }

    /// Does a job. The next one may be given when its result was taken.
    pub(crate) fn start_job(&self, job: J) {
        // The stream of results reports a thread that has ended.
        let sent = self.jobs.try_send(job);
        let is_full = sent.is_err_and(|error| error.is_full());
        debug_assert!(!is_full, "one job at a time");
    }
}
