//! The thread that computes plans, so that heartbeats continue meanwhile.

use std::sync::Arc;
use std::thread;

use async_channel::{Receiver, Sender, unbounded};
use formation::protocol::{ComputedPlan, PlanJob};
use futures::{Stream, StreamExt, stream};
use ros_runtime::session::SessionError;

/// Computes one plan after another. The thread ends with the last sender of jobs, or with the process.
pub(crate) struct PlanWorker {
    jobs: Sender<PlanJob>,
}

impl PlanWorker {
    /// Starts the thread. The stream yields the results, and `None` if the thread has ended with jobs left.
    ///
    /// # Errors
    /// The machine has no thread left.
    pub(crate) fn start()
    -> Result<(Self, impl Stream<Item = Option<Arc<ComputedPlan>>>), SessionError> {
        let (jobs, received) = unbounded();
        let (sender, results) = unbounded();
        thread::Builder::new()
            .name("plans".to_owned())
            .spawn(move || work(&received, &sender))
            .map_err(|error| {
                SessionError::Failed(format!("no thread for plans can be started: {error}"))
            })?;
        let results = results.map(Some).chain(stream::iter([None]));
        Ok((Self { jobs }, results))
    }

    /// Computes a plan as soon as those before it are computed.
    pub(crate) fn compute(&self, job: PlanJob) {
        // The stream of results reports a thread that has ended.
        let _ = self.jobs.try_send(job);
    }
}

fn work(jobs: &Receiver<PlanJob>, results: &Sender<Arc<ComputedPlan>>) {
    while let Ok(job) = jobs.recv_blocking() {
        if results.send_blocking(Arc::new(job.run())).is_err() {
            return;
        }
    }
}
