//! What the DDS library tells of other participants: which of their readers receive what this process sends, and who is back.

use std::cell::RefCell;
use std::collections::{BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::Instant;

use rustdds::{
    DomainParticipant, DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID,
    LostReason, RTPSEntity, StatusEvented,
};

use crate::returned_participants::ReturnedParticipants;
use crate::subscription::ParticipantId;

/// The first bytes of each identifier of RustDDS, as its vendor's number says.
const RUST_DDS: [u8; 2] = [0x01, 0x12];

/// So many that have left are kept for a program that does not ask.
const DEPARTED_MAX: usize = 1_024;

/// The remote readers that a writer of this participant has matched, and the participants that came back.
///
/// Discovery lists a reader before the writer knows it, and a volatile sample that is sent between the two never reaches
/// that reader. The library's events are the only evidence that the writer knows it.
#[derive(Clone)]
pub(crate) struct ParticipantEvents(Rc<RefCell<State>>);

struct State {
    own: GUID,
    events: DomainParticipantStatusListener,
    readers: BTreeSet<GUID>,
    returned: ReturnedParticipants,
    /// Those that have left, until they are taken.
    departed: VecDeque<ParticipantId>,
}

impl ParticipantEvents {
    /// Reads the events of this participant. Nothing else may read them, as each is given out once.
    pub(crate) fn of(participant: &DomainParticipant) -> Self {
        Self(Rc::new(RefCell::new(State {
            own: participant.guid(),
            events: participant.status_listener(),
            readers: BTreeSet::new(),
            returned: ReturnedParticipants::default(),
            departed: VecDeque::new(),
        })))
    }

    /// Takes in the events so far; the library drops events when 2,048 wait.
    pub(crate) fn update(&self) {
        let state = &mut *self.0.borrow_mut();
        while let Some(event) = state.events.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::RemoteReaderMatched { remote_reader, .. } => {
                    state.readers.insert(remote_reader);
                }
                DomainParticipantStatusEvent::ReaderLost { guid, .. } => {
                    state.readers.remove(&guid);
                }
                DomainParticipantStatusEvent::ParticipantDiscovered { dpd } => {
                    let id = ParticipantId::of_prefix(dpd.guid.prefix.as_ref());
                    state.returned.note_discovered(Instant::now(), id);
                }
                DomainParticipantStatusEvent::ParticipantLost { id, reason } => {
                    // Others with shorter leases, which are lost on a poor link again and again, are not worth a halt.
                    let is_rust_dds = id.as_ref().starts_with(&RUST_DDS);
                    let id = ParticipantId::of_prefix(id.as_ref());
                    match reason {
                        LostReason::Timeout { .. } if is_rust_dds => state.returned.note_lost(id),
                        LostReason::Timeout { .. } => {}
                        LostReason::Disposed => {
                            state.returned.note_left(id);
                            if state.departed.len() >= DEPARTED_MAX {
                                state.departed.pop_front();
                            }
                            state.departed.push_back(id);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// The participants that have left by themselves since the last call.
    pub(crate) fn take_departed(&self) -> Vec<ParticipantId> {
        self.0.borrow_mut().departed.drain(..).collect()
    }

    /// The participants that were lost, came back, and have stayed, each once.
    pub(crate) fn take_returned(&self) -> BTreeSet<ParticipantId> {
        self.update();
        self.0.borrow_mut().returned.take_stayed(Instant::now())
    }

    /// Whether a writer of this process has matched one of another participant.
    pub(crate) fn is_any(&self) -> bool {
        self.update();
        let state = self.0.borrow();
        let mut readers = state.readers.iter();
        readers.any(|reader| reader.prefix != state.own.prefix)
    }

    /// Whether a writer of this process has matched the reader.
    pub(crate) fn contains(&self, reader: GUID) -> bool {
        self.update();
        self.0.borrow().readers.contains(&reader)
    }
}
