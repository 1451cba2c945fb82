//! Requests to report a body as removed, by service or command, and how they are answered.
//!
//! Agents drop a report at the next heartbeat of the run that it names, and believe it where nobody hears the module. So whoever reports
//! a removal listens first: the module must be known and silent, and the report names its latest run.

use std::time::Duration;

use formation_model::text::listed_in_full;
use formation_model::{Incarnation, ModuleId, ModuleRun, NO_ID, Timing};
use formation_msgs::{RemoveModuleRequest, RemoveModuleResponse};
use ros_runtime::service::{Call, Reply};

/// How long one listens for heartbeats at least.
const LISTENING_MIN: Duration = Duration::from_millis(1_500);
/// How many heartbeats of a living module would come meanwhile.
const HEARTBEATS: u32 = 3;
/// A heartbeat that comes this soon after a request may have been sent before the process ended.
const ON_THE_WAY: Duration = Duration::from_millis(250);
/// How many requests may wait.
const WAITING_MAX: usize = 64;

/// How long to listen for heartbeats of modules with these times, if they are known.
#[must_use]
pub fn listening(timing: Option<Timing>) -> Duration {
    timing.map_or(LISTENING_MIN, |timing| {
        LISTENING_MIN.max(timing.heartbeat * HEARTBEATS)
    })
}

/// That heartbeats of some modules arrive.
#[must_use]
pub fn are_alive(modules: impl IntoIterator<Item = ModuleId>) -> String {
    let modules = listed_in_full(modules);
    format!(
        "heartbeats of {modules} arrive, so nothing was removed: end the processes before the bodies are reported as removed"
    )
}

/// That nothing is known of some modules.
#[must_use]
pub fn are_unknown(modules: impl IntoIterator<Item = ModuleId>) -> String {
    let modules = listed_in_full(modules);
    format!(
        "no message of {modules} came, nor a roster that lists it, so nothing was removed: is the number right?"
    )
}

/// That the bodies of some modules were reported as removed, and when that takes effect.
#[must_use]
pub fn were_reported(
    modules: impl IntoIterator<Item = ModuleId>,
    timing: Option<Timing>,
) -> String {
    let modules = listed_in_full(modules);
    let suspicion = timing.map_or(String::new(), |timing| {
        format!(" ({} s)", timing.suspicion.as_secs_f64())
    });
    format!(
        "reported the body of {modules} as removed: this takes effect in the next roster after no member has heard it for \
         suspicion_s{suspicion}, which is made at once if a spare can take a spot; a heartbeat of it drops the report"
    )
}

/// A request that waits for its answer.
pub struct Request {
    /// The module.
    pub module: ModuleId,
    incarnation: Incarnation,
    /// Heartbeats that are sent after this show that the module lives.
    pub heard_after: Duration,
    due: Duration,
    reply: Reply<RemoveModuleResponse>,
}

impl Request {
    /// The run to report as removed, given the latest that is known.
    ///
    /// # Errors
    /// Says why none is.
    pub fn resolve(&self, latest: Option<ModuleRun>) -> Result<ModuleRun, String> {
        let latest = latest.ok_or_else(|| are_unknown([self.module]))?;
        let asked = self.incarnation;
        if asked != Incarnation(0) && asked != latest.incarnation {
            return Err(format!(
                "the latest known run of {} has the incarnation {}, not {}, so nothing was removed",
                self.module, latest.incarnation.0, asked.0
            ));
        }
        Ok(latest)
    }

    /// Answers.
    pub fn answer(self, outcome: Result<String, String>) {
        let module = self.module.0;
        match &outcome {
            Ok(_) => tracing::info!(module, "reported a body as removed"),
            Err(reason) => tracing::warn!(module, "refused a request: {reason}"),
        }
        (self.reply)(outcome.into());
    }
}

/// The requests of clients that wait until the server has listened.
#[derive(Default)]
pub struct Requests(Vec<Request>);

impl Requests {
    /// Keeps a request of this time until the server has listened for heartbeats, or refuses it at once.
    pub fn add(
        &mut self,
        now: Duration,
        timing: Option<Timing>,
        call: Call<RemoveModuleRequest, RemoveModuleResponse>,
    ) {
        let RemoveModuleRequest {
            module_id,
            incarnation,
        } = call.request;
        let request = Request {
            module: ModuleId(module_id),
            incarnation: Incarnation(incarnation),
            heard_after: now + ON_THE_WAY,
            due: now + ON_THE_WAY + listening(timing),
            reply: call.reply,
        };
        if module_id == NO_ID {
            let reason = format!("module_id: {NO_ID} is reserved and cannot be used");
            return request.answer(Err(reason));
        }
        if self.0.len() >= WAITING_MAX {
            let reason = format!("{WAITING_MAX} requests wait for an answer; ask again later");
            return request.answer(Err(reason));
        }
        self.0.push(request);
    }

    /// Refuses the requests for a module of which a heartbeat came at this time.
    pub fn refuse_living(&mut self, now: Duration, module: ModuleId) {
        if self.0.is_empty() {
            return;
        }
        let lives = |request: &Request| request.module == module && now > request.heard_after;
        for request in self.take_if(lives) {
            request.answer(Err(are_alive([module])));
        }
    }

    /// The requests for which the server has listened.
    pub fn take_due(&mut self, now: Duration) -> Vec<Request> {
        self.take_if(|request| now >= request.due)
    }

    fn take_if(&mut self, is_taken: impl Fn(&Request) -> bool) -> Vec<Request> {
        let (taken, kept) = std::mem::take(&mut self.0).into_iter().partition(is_taken);
        self.0 = kept;
        taken
    }

    /// When the next one is due.
    #[must_use]
    pub fn due(&self) -> Option<Duration> {
        self.0.iter().map(|request| request.due).min()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use super::*;

    type Answers = Rc<RefCell<Vec<(bool, String)>>>;

    fn call(
        answers: &Answers,
        module_id: u32,
        incarnation: u64,
    ) -> Call<RemoveModuleRequest, RemoveModuleResponse> {
        let answers = Rc::clone(answers);
        Call {
            request: RemoveModuleRequest {
                module_id,
                incarnation,
            },
            reply: Box::new(move |answer: RemoveModuleResponse| {
                answers
                    .borrow_mut()
                    .push((answer.success, answer.message.to_string()));
            }),
        }
    }

    #[test]
    fn a_request_is_refused_while_heartbeats_arrive() {
        let (answers, second) = (Answers::default(), Duration::from_secs(1));
        let mut requests = Requests::default();
        requests.add(second, None, call(&answers, 4, 0));
        // One that was on its way when the process ended says nothing.
        requests.refuse_living(second + ON_THE_WAY / 2, ModuleId(4));
        requests.refuse_living(second * 2, ModuleId(5));
        assert!(answers.borrow().is_empty());
        requests.refuse_living(second * 2, ModuleId(4));
        let (success, message) = answers.borrow()[0].clone();
        assert!(!success && message.contains("heartbeats of module 4 arrive"));
        assert_eq!(requests.due(), None);
    }

    #[test]
    fn a_request_waits_for_three_heartbeats_and_names_the_run_that_is_known() {
        let (answers, second) = (Answers::default(), Duration::from_secs(1));
        let mut requests = Requests::default();
        let timing = Timing {
            heartbeat: second * 2,
            suspicion: second * 20,
            lease: second * 10,
        };
        requests.add(second, Some(timing), call(&answers, 4, 0));
        requests.add(second, Some(timing), call(&answers, 4, 6));
        let due = requests.due().unwrap();
        assert!(due > second * 7);
        assert!(requests.take_due(second * 7).is_empty());
        let [any, sixth] = <[Request; 2]>::try_from(requests.take_due(due))
            .ok()
            .unwrap();
        let latest = ModuleId(4).run(Incarnation(7));
        assert_eq!(any.resolve(Some(latest)), Ok(latest));
        assert!(
            any.resolve(None)
                .unwrap_err()
                .contains("no message of module 4")
        );
        let wrong = sixth.resolve(Some(latest)).unwrap_err();
        assert!(wrong.contains("incarnation 7, not 6"), "{wrong}");
    }

    #[test]
    fn requests_that_wait_are_bounded() {
        let answers = Answers::default();
        let mut requests = Requests::default();
        for module in 0..100 {
            requests.add(Duration::ZERO, None, call(&answers, module, 0));
        }
        requests.add(Duration::ZERO, None, call(&answers, NO_ID, 0));
        assert_eq!(answers.borrow().len(), 100 - WAITING_MAX + 1);
    }
}
