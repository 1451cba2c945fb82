//! Docking by a driver outside: one request after another, each repeated until it is answered or its time is up.

use std::collections::VecDeque;
use std::time::Duration;

use crate::model::ModuleId;
use crate::protocol::MotionReport;

/// A request that was not answered is sent again after so long: drivers may come late, and messages may be lost.
const REPEAT_AFTER: Duration = Duration::from_millis(500);

/// What a driver is to do with one of its module's ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DockingAction {
    /// Couple with the other module.
    Dock,
    /// Let go of the other module.
    Undock,
}

/// What a module asks of its driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DockingRequest {
    /// Distinguishes it from all others of the module, those of its earlier processes included.
    pub request: u64,
    /// What to do.
    pub action: DockingAction,
    /// The other module.
    pub other: ModuleId,
}

/// What a driver answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DockingResult {
    /// Which request it answers.
    pub request: u64,
    /// Whether it is done, or why not.
    pub outcome: Result<(), String>,
}

/// Why docking failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum DockingFault {
    /// The driver never answered.
    Unanswered(DockingRequest),
    /// The driver says that it cannot.
    Refused(DockingRequest, String),
}

/// The requests of one module, in the order in which they were made.
#[derive(Clone, Debug)]
pub(super) struct DockingQueue {
    limit: Duration,
    next_request: u64,
    waiting: VecDeque<DockingRequest>,
    /// When the first one in the queue was sent at first, and last.
    sent: Option<(Duration, Duration)>,
}

impl DockingQueue {
    /// Requests are numbered from `first_request`; each must be answered within `limit`.
    pub(super) fn new(limit: Duration, first_request: u64) -> Self {
        Self {
            limit,
            next_request: first_request,
            waiting: VecDeque::new(),
            sent: None,
        }
    }

    /// Adds a request, unless the same waits already.
    pub(super) fn ask(&mut self, action: DockingAction, other: ModuleId) {
        let waits = |request: &DockingRequest| request.action == action && request.other == other;
        if self.waiting.iter().any(waits) {
            return;
        }
        self.waiting.push_back(DockingRequest {
            request: self.next_request,
            action,
            other,
        });
        self.next_request = self.next_request.wrapping_add(1);
    }

    /// What to send now, if anything; all requests are dropped when the first one's time is up.
    pub(super) fn advance(
        &mut self,
        now: Duration,
    ) -> Result<Option<DockingRequest>, DockingFault> {
        let Some(&request) = self.waiting.front() else {
            return Ok(None);
        };
        let (first, last) = self.sent.unwrap_or((now, now));
        if now >= first + self.limit {
            self.clear();
            return Err(DockingFault::Unanswered(request));
        }
        if self.sent.is_some() && now < last + REPEAT_AFTER {
            return Ok(None);
        }
        self.sent = Some((first, now));
        Ok(Some(request))
    }

    /// Takes an answer; `None` when it is not to the request that was sent last.
    pub(super) fn hear(
        &mut self,
        result: DockingResult,
    ) -> Option<Result<MotionReport, DockingFault>> {
        let request = *self.waiting.front()?;
        if self.sent.is_none() || request.request != result.request {
            return None;
        }
        Some(match result.outcome {
            Ok(()) => {
                self.waiting.pop_front();
                self.sent = None;
                Ok(match request.action {
                    DockingAction::Dock => MotionReport::Docked(request.other),
                    DockingAction::Undock => MotionReport::Undocked(request.other),
                })
            }
            Err(reason) => {
                self.clear();
                Err(DockingFault::Refused(request, reason))
            }
        })
    }

    /// When [`Self::advance`] has something to do next.
    pub(super) fn due(&self) -> Option<Duration> {
        self.waiting.front()?;
        Some(match self.sent {
            None => Duration::ZERO,
            Some((first, last)) => (last + REPEAT_AFTER).min(first + self.limit),
        })
    }

    fn clear(&mut self) {
        self.waiting.clear();
        self.sent = None;
    }
}
