//! Meeting participants of Fast DDS before endpoints are created.
//!
//! RustDDS 0.15.1 writes what it tells of its endpoints without time stamps. Fast DDS keeps such samples of all participants in one list,
//! by time and for each participant by number, and appends what has an equal time. Where the list holds the later endpoints of
//! a participant, whose earlier ones it has yet to ask for, and in between those of another participant, it never looks at
//! the earlier ones when they come: it acknowledges them, and stays blind to them. So a participant of Fast DDS must not meet
//! this one while endpoints are created: either before, and all arrive in order, or after, and it asks for all.

use std::thread;
use std::time::{Duration, Instant};

use rustdds::{DomainParticipant, DomainParticipantStatusEvent, StatusEvented};

/// A participant that hears of a new one answers at once.
const ANSWER_MAX: Duration = Duration::from_millis(200);
/// From its answer until it knows where endpoints are told of.
const MEETING: Duration = Duration::from_millis(300);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(10);
/// The first bytes of each identifier of Fast DDS, as its vendor's number says.
const FAST_DDS: [u8; 2] = [0x01, 0x0f];

/// Waits until those participants of Fast DDS that are in the domain already have met this one, which has no endpoint yet.
/// Takes the events of the participant until then, which tell of no endpoint of its own.
pub(crate) fn meet(participant: &DomainParticipant) {
    let events = participant.status_listener();
    let mut until = Instant::now() + ANSWER_MAX;
    while Instant::now() < until {
        thread::sleep(LOOK);
        while let Some(event) = events.try_recv_status() {
            if let DomainParticipantStatusEvent::ParticipantDiscovered { dpd } = event
                && dpd.guid.prefix.as_ref().starts_with(&FAST_DDS)
            {
                until = until.max(Instant::now() + MEETING);
            }
        }
    }
}
