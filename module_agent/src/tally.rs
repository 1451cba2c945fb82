//! What a hosted module has done so far, for `/diagnostics`.

use std::time::Duration;

use formation::model::{Message, ModulePhase, ModuleState};
use formation::protocol::{Agent, Event, Severity};

use ros_runtime::diagnostics::{DiagnosticLevel, Report};

/// The counts of one module.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// Messages of others that it was told.
    pub received: u64,
    sent: u64,
    /// How often it was evicted.
    evicted: u64,
    /// How often it evicted another.
    evictions: u64,
    /// The phase and since when.
    phase: Option<(ModulePhase, Duration)>,
    /// The worst that happened since the phase began.
    trouble: Option<(Severity, String)>,
}

impl Tally {
    pub(crate) fn count_sent(&mut self, message: &Message) {
        self.sent += 1;
        if let Message::Eviction(_) = message {
            self.evictions += 1;
        }
    }

    pub(crate) fn note(&mut self, event: &Event) {
        if let Event::Evicted { .. } = event {
            self.evicted += 1;
        }
        let severity = event.severity();
        let is_worse = self
            .trouble
            .as_ref()
            .is_none_or(|(worst, _)| severity >= *worst);
        if severity > Severity::Info && is_worse {
            self.trouble = Some((severity, event.to_string()));
        }
    }

    pub(crate) fn observe_phase(&mut self, now: Duration, phase: ModulePhase) {
        if self.phase.is_none_or(|(known, _)| known != phase) {
            self.phase = Some((phase, now));
            self.trouble = None;
        }
    }

    pub(crate) fn report(
        &self,
        now: Duration,
        agent: &Agent,
        state: Option<&ModuleState>,
    ) -> Report {
        let module = agent.module().0;
        let phase = agent.phase();
        let since = self.phase.map_or(now, |(_, since)| since);
        let or_none = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
        let mut values = vec![
            ("phase", phase.name().to_owned()),
            (
                "time_in_phase_s",
                format!("{:.1}", now.saturating_sub(since).as_secs_f64()),
            ),
            (
                "epoch",
                or_none(agent.epoch().map(|epoch| epoch.to_string())),
            ),
            ("turn", agent.applied_turns().to_string()),
            (
                "spot",
                or_none(
                    state
                        .and_then(|state| state.spot)
                        .map(|spot| spot.0.to_string()),
                ),
            ),
            ("messages_sent", self.sent.to_string()),
            ("messages_received", self.received.to_string()),
            ("evictions", self.evictions.to_string()),
            ("evicted", self.evicted.to_string()),
        ]
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect::<Vec<_>>();
        values.extend(
            agent
                .refusals()
                .iter()
                .map(|(refusal, count)| (format!("refused.{}", refusal.name()), count.to_string())),
        );
        let (level, message) = match &self.trouble {
            Some((Severity::Error, trouble)) => (DiagnosticLevel::Error, trouble.clone()),
            Some((_, trouble)) => (DiagnosticLevel::Warning, trouble.clone()),
            None if phase == ModulePhase::WaitingForQuorum => (
                DiagnosticLevel::Warning,
                "too few modules are within reach to decide anything".to_owned(),
            ),
            None => (DiagnosticLevel::Ok, phase.name().to_owned()),
        };
        Report {
            part: format!("module {module}"),
            hardware_id: format!("module_{module}"),
            level,
            message,
            values,
        }
    }
}
