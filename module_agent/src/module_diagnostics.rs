//! The status of a hosted module, for `/diagnostics`.

use std::time::Duration;

use formation_model::{Message, ModulePhase, ModuleState};
use formation_protocol::{Agent, Event, Severity};
use ros_runtime::diagnostics::{DiagnosticLevel, Report};

/// The counts of one module.
#[derive(Debug, Default)]
pub(crate) struct ModuleDiagnostics {
    /// Messages of others that it received.
    pub received: u64,
    sent: u64,
    /// How often it was evicted.
    evicted: u64,
    /// How often it evicted another.
    evictions: u64,
    /// The phase and since when.
    phase: Option<(ModulePhase, Duration)>,
    /// The worst event since the phase began.
    worst: Option<(Severity, String)>,
}

impl ModuleDiagnostics {
    pub(crate) fn count_sent(&mut self, message: &Message) {
        self.sent += 1;
        if let Message::Eviction(_) = message {
            self.evictions += 1;
        }
    }

    pub(crate) fn handle_event(&mut self, event: &Event) {
        if let Event::Evicted { .. } = event {
            self.evicted += 1;
        }
        let severity = event.severity();
        let worst = self.worst.as_ref();
        if severity > Severity::Info && worst.is_none_or(|(worst, _)| severity >= *worst) {
            self.worst = Some((severity, event.to_string()));
        }
    }

    pub(crate) fn handle_phase(&mut self, now: Duration, phase: ModulePhase) {
        if self.phase.is_none_or(|(known, _)| known != phase) {
            self.phase = Some((phase, now));
            self.worst = None;
        }
    }

    pub(crate) fn report(
        &self,
        now: Duration,
        agent: &Agent,
        state: Option<&ModuleState>,
    ) -> Report {
        let (module, phase) = (agent.module().0, agent.phase());
        let since = self.phase.map_or(now, |(_, since)| since);
        let in_phase = now.saturating_sub(since).as_secs_f64();
        let or_none = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
        let spot = state
            .and_then(|state| state.spot)
            .map(|spot| spot.0.to_string());
        let figures = [
            ("phase", phase.name().to_owned()),
            ("time_in_phase_s", format!("{in_phase:.1}")),
            (
                "epoch",
                or_none(agent.epoch().map(|epoch| epoch.to_string())),
            ),
            ("turn", agent.applied_turns().to_string()),
            ("spot", or_none(spot)),
            ("messages_sent", self.sent.to_string()),
            ("messages_received", self.received.to_string()),
            ("evictions", self.evictions.to_string()),
            ("evicted", self.evicted.to_string()),
        ];
        let refusals = agent.refusals().iter();
        let refusals = refusals
            .map(|(refusal, count)| (format!("refused.{}", refusal.name()), count.to_string()));
        let figures = figures
            .into_iter()
            .map(|(key, value)| (key.to_owned(), value));
        let (level, message) = match &self.worst {
            Some((Severity::Error, event)) => (DiagnosticLevel::Error, event.clone()),
            Some((_, event)) => (DiagnosticLevel::Warning, event.clone()),
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
            values: figures.chain(refusals).collect(),
        }
    }
}
