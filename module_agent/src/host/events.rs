//! The events that the agents report: counted, and logged.

use formation_protocol::{Event, Severity};
use ros_runtime::topic_statistics::is_logged;

use super::Hosted;

impl Hosted {
    /// Counts and logs an event.
    pub(super) fn handle_event(&mut self, event: &Event) {
        self.diagnostics.handle_event(event);
        // Events that others can cause at will must not flood the log.
        let count = match event {
            Event::Refused { .. } => Some(&mut self.refusals),
            Event::DuplicateModule(_) => Some(&mut self.duplicates),
            Event::ClockInDoubt { .. } => Some(&mut self.clock_doubts),
            // Reports name modules that this one knows, so there are no more counts than that.
            Event::RemovalProposed(module)
            | Event::RemovalRefuted(module)
            | Event::RemovalOverruled(module) => Some(self.removals.entry(*module).or_default()),
            _ => None,
        };
        if let Some(count) = count {
            *count += 1;
            if !is_logged(*count) {
                return;
            }
        }
        let module = self.identity.module.0;
        match event.severity() {
            Severity::Info => tracing::info!(module, "{event}"),
            Severity::Warning => tracing::warn!(module, "{event}"),
            Severity::Error => tracing::error!(module, "{event}"),
        }
    }
}
