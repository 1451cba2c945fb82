//! The docking requests of one module, one at a time, each repeated until it is answered or its limit is reached.

use std::collections::VecDeque;
use std::time::Duration;

use super::fault::DriveFault;
use super::goal::MotionReport;
use formation_model::{DockingAction, DockingRequest, DockingResult, ModuleId};

/// The requests of one module in the order in which they were made.
#[derive(Clone, Debug)]
pub(super) struct DockingQueue {
    limit: Duration,
    repeat: Duration,
    next_request: u64,
    waiting: VecDeque<DockingRequest>,
    /// When the first request of the queue was sent for the first time, and for the last time.
    sent: Option<(Duration, Duration)>,
}

impl DockingQueue {
    /// Requests are numbered from `first_request`; each must be answered within `limit`, and is repeated after `repeat` until then.
    pub(super) fn new(limit: Duration, repeat: Duration, first_request: u64) -> Self {
        Self {
            limit,
            repeat,
            next_request: first_request,
            waiting: VecDeque::new(),
            sent: None,
        }
    }

    /// Adds a request, unless an equal one waits already.
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

    /// The request to send now, if one is due. All requests are dropped when the first one reaches its limit.
    pub(super) fn advance(&mut self, now: Duration) -> Result<Option<DockingRequest>, DriveFault> {
        let Some(&request) = self.waiting.front() else {
            return Ok(None);
        };
        let (first, last) = self.sent.unwrap_or((now, now));
        let limit = self.limit;
        if now >= first + limit {
            self.clear();
            return Err(DriveFault::DockingUnanswered { request, limit });
        }
        if self.sent.is_some() && now < last + self.repeat {
            return Ok(None);
        }
        self.sent = Some((first, now));
        Ok(Some(request))
    }

    /// Handles an answer; `None` if it is not to the request that was sent last.
    pub(super) fn handle_result(
        &mut self,
        result: DockingResult,
    ) -> Option<Result<MotionReport, DriveFault>> {
        let request = *self.waiting.front()?;
        if self.sent.is_none() || request.request != result.request {
            return None;
        }
        if let Err(reason) = result.outcome {
            self.clear();
            return Some(Err(DriveFault::DockingRefused { request, reason }));
        }
        self.waiting.pop_front();
        self.sent = None;
        Some(Ok(match request.action {
            DockingAction::Dock => MotionReport::Docked(request.other),
            DockingAction::Undock => MotionReport::Undocked(request.other),
        }))
    }

    /// The time at which the next call of [`Self::advance`] is due.
    pub(super) fn due(&self) -> Option<Duration> {
        self.waiting.front()?;
        Some(match self.sent {
            None => Duration::ZERO,
            Some((first, last)) => (last + self.repeat).min(first + self.limit),
        })
    }

    fn clear(&mut self) {
        self.waiting.clear();
        self.sent = None;
    }
}
