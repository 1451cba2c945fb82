//! Where questions come in, with all that one must hear to answer them.

use formation_msgs::{Heartbeat, ModuleStates, Roster, SpotClaim, TargetConfiguration};
use futures::StreamExt;
use futures::stream::LocalBoxStream;

use super::services::{FormationServices, Question};
use crate::facilities::{FacilityArrival, FacilityInlets};
use crate::inlet::{Delivery, Inlet};
use crate::session::{Session, SessionError};
use crate::topics;

/// What comes in.
pub(super) enum Arrival {
    Facility(FacilityArrival),
    Sample(Delivery),
    Question(Question),
}

/// Where questions come in, with all that one must hear to answer them.
pub(super) struct Desk {
    pub(super) services: FormationServices,
    target: Inlet<TargetConfiguration>,
    states: Inlet<ModuleStates>,
    roster: Inlet<Roster>,
    claims: Inlet<SpotClaim>,
    heartbeats: Inlet<Heartbeat>,
}

impl Desk {
    pub(super) fn open(session: &mut Session) -> Result<Self, SessionError> {
        Ok(Self {
            services: FormationServices::open(session)?,
            target: Inlet::open(session, &topics::TARGET)?,
            states: Inlet::open(session, &topics::MODULE_STATES)?,
            roster: Inlet::open(session, &topics::ROSTER)?,
            claims: Inlet::open(session, &topics::claims(1))?,
            heartbeats: Inlet::open(session, &topics::HEARTBEATS)?,
        })
    }

    fn arrivals(&self) -> Vec<LocalBoxStream<'_, Arrival>> {
        let samples = [
            self.target.deliveries(),
            self.states.deliveries(),
            self.roster.deliveries(),
            self.claims.deliveries(),
            self.heartbeats.deliveries(),
        ];
        let samples = samples
            .into_iter()
            .map(|samples| samples.map(Arrival::Sample).boxed_local());
        let questions = self.services.questions().into_iter();
        samples
            .chain(questions.map(|questions| questions.map(Arrival::Question).boxed_local()))
            .collect()
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
