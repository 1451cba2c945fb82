//! Where others ask, with all that one must hear to answer them.

use formation_msgs::{
    FormConfigurationFeedback, FormConfigurationGoal, FormConfigurationResult, Heartbeat,
    ModuleStates, Roster, SpotClaim, TargetConfiguration, Verdict,
};
use futures::StreamExt;
use futures::stream::LocalBoxStream;
use ros2_client::Subscription;

use super::services::{FormationServices, Question};
use formation_node::inlet::{Delivery, deliveries};
use formation_node::topics;
use ros_runtime::action::{ActionRequest, ActionServer, ActionType};
use ros_runtime::facilities::{FacilityArrival, FacilityInlets};
use ros_runtime::inlet::Inlet;
use ros_runtime::session::{Session, SessionError};
use ros_runtime::traffic::RefusalKind;

pub(super) struct FormConfiguration;

impl ActionType for FormConfiguration {
    const PACKAGE: &'static str = "formation_msgs";
    const NAME: &'static str = "FormConfiguration";
    type Goal = FormConfigurationGoal;
    type Result = FormConfigurationResult;
    type Feedback = FormConfigurationFeedback;
}

/// What comes in.
pub(super) enum Arrival {
    Facility(FacilityArrival),
    Sample(Delivery),
    Verdict(Result<Verdict, (RefusalKind, String)>),
    Question(Question),
    Action(ActionRequest<FormConfigurationGoal>),
}

/// Where others ask, with all that one must hear to answer them.
pub(super) struct Desk {
    pub(super) services: FormationServices,
    pub(super) action: ActionServer<FormConfiguration>,
    target: Inlet<TargetConfiguration>,
    states: Inlet<ModuleStates>,
    roster: Inlet<Roster>,
    claims: Inlet<SpotClaim>,
    heartbeats: Inlet<Heartbeat>,
    verdict: Subscription<Verdict>,
}

impl Desk {
    pub(super) fn open(session: &mut Session) -> Result<Self, SessionError> {
        Ok(Self {
            services: FormationServices::open(session)?,
            action: ActionServer::open(session, "form_configuration")?,
            target: Inlet::open(session, &topics::TARGET)?,
            states: Inlet::open(session, &topics::MODULE_STATES)?,
            roster: Inlet::open(session, &topics::ROSTER)?,
            claims: Inlet::open(session, &topics::claims(1))?,
            heartbeats: Inlet::open(session, &topics::HEARTBEATS)?,
            verdict: session.subscription(&topics::VERDICT)?,
        })
    }

    fn arrivals(&self) -> Vec<LocalBoxStream<'_, Arrival>> {
        let samples = [
            deliveries(&self.target),
            deliveries(&self.states),
            deliveries(&self.roster),
            deliveries(&self.claims),
            deliveries(&self.heartbeats),
        ];
        let mut arrivals: Vec<LocalBoxStream<'_, Arrival>> = samples
            .into_iter()
            .map(|samples| samples.map(Arrival::Sample).boxed_local())
            .collect();
        let verdicts = self.verdict.async_stream().map(|taken| {
            Arrival::Verdict(match taken {
                Ok((verdict, _)) => checked(verdict),
                Err(error) => Err((RefusalKind::Malformed, error.to_string())),
            })
        });
        arrivals.push(verdicts.boxed_local());
        for questions in self.services.requests() {
            arrivals.push(questions.map(Arrival::Question).boxed_local());
        }
        for requests in self.action.requests() {
            arrivals.push(requests.map(Arrival::Action).boxed_local());
        }
        arrivals
    }
}

/// A verdict with an outcome that means something.
fn checked(verdict: Verdict) -> Result<Verdict, (RefusalKind, String)> {
    match verdict.outcome {
        Verdict::OUTCOME_COMPLETE | Verdict::OUTCOME_PARTIAL | Verdict::OUTCOME_FAILED => {
            Ok(verdict)
        }
        unknown => Err((
            RefusalKind::Invalid,
            format!("outcome: {unknown} is unknown; known are COMPLETE 1, PARTIAL 2, FAILED 3"),
        )),
    }
}

/// All that comes in.
pub(super) fn arrivals<'a>(
    facilities: &'a FacilityInlets,
    desk: Option<&'a Desk>,
) -> Vec<LocalBoxStream<'a, Arrival>> {
    let facilities = facilities
        .arrivals()
        .into_iter()
        .map(|arrivals| arrivals.map(Arrival::Facility).boxed_local());
    facilities
        .chain(desk.into_iter().flat_map(Desk::arrivals))
        .collect()
}
