//! The status of the formation: what is announced, by this process and by others, the progress of the modules, and the
//! verifier's verdict. This module knows no DDS.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Heartbeat, MODULES_MAX, Message, ModuleId, ModulePhase, TargetAnnouncement};
use formation_msgs::{Epoch, Progress, QueryStatusRequest, QueryStatusResponse, Verdict};
use formation_verify::{self as verify, Observer, ObserverParameters};
use ros2_client::builtin_interfaces::Time;

/// A module that is silent for longer is not waited for.
const LIVE: Duration = Duration::from_secs(5);

/// The status of the formation.
pub(crate) struct FormationStatus {
    /// What this process announced last.
    own: Option<Arc<TargetAnnouncement>>,
    observer: Observer,
    /// The latest heartbeat of each module, and when it arrived.
    heartbeats: BTreeMap<ModuleId, (Heartbeat, Duration)>,
    /// The latest verdict, and when it arrived.
    verdict: Option<(Verdict, Duration)>,
}

impl Default for FormationStatus {
    fn default() -> Self {
        Self {
            own: None,
            observer: Observer::new(ObserverParameters::default()),
            heartbeats: BTreeMap::new(),
            verdict: None,
        }
    }
}

impl FormationStatus {
    /// What this process announced last, if anything; a withdrawal included.
    pub(crate) fn own(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.own.as_ref()
    }

    /// Takes in a message of a module or publisher.
    pub(crate) fn handle_message(&mut self, now: Duration, message: &Message) {
        self.observer.handle(now, message);
        if let Message::Heartbeat(heartbeat) = message {
            let known = self.heartbeats.get(&heartbeat.module);
            let order = |heartbeat: &Heartbeat| (heartbeat.incarnation, heartbeat.sequence);
            let is_new = known.is_none_or(|(known, _)| order(known) < order(heartbeat));
            let has_room = known.is_some() || self.heartbeats.len() < MODULES_MAX;
            if is_new && has_room {
                self.heartbeats
                    .insert(heartbeat.module, (heartbeat.clone(), now));
            }
        }
    }

    /// Takes in a verdict.
    pub(crate) fn handle_verdict(&mut self, now: Duration, verdict: Verdict) {
        self.verdict = Some((verdict, now));
    }

    /// The progress of the formation.
    pub(crate) fn progress(&self) -> verify::Progress {
        self.observer.progress()
    }

    /// The verdict on the current target, for a goal that began at `began` and was accepted at `stamp`.
    ///
    /// A formation may have been complete before the goal was sent; an earlier failure proves nothing. A verdict without
    /// an epoch, as after a failure to reach any plan, shows by its stamp alone which target it is about.
    pub(crate) fn verdict_on(&self, began: Duration, stamp: Time) -> Option<&Verdict> {
        let (verdict, arrived) = self.verdict.as_ref()?;
        let failed = verdict.outcome == Verdict::OUTCOME_FAILED;
        let fits = if verdict.epoch.number == 0 {
            let found = verdict.header.stamp;
            failed && Time::new(found.sec, found.nanosec) >= stamp
        } else {
            let current = self.observer.current_epoch()?;
            verdict.epoch == Epoch::from(&current)
        };
        (fits && (!failed || *arrived >= began)).then_some(verdict)
    }

    /// What took the place of the target of this revision, if anything did: another target, or a withdrawal.
    pub(crate) fn newer_than(&self, revision: u64) -> Option<String> {
        self.target_newer_than(revision).or_else(|| {
            let newer = self.observer.target()?.revision;
            (newer > revision).then(|| format!("revision {newer} withdrew the target"))
        })
    }

    /// Which target took the place of the one of this revision, if any did.
    pub(crate) fn target_newer_than(&self, revision: u64) -> Option<String> {
        let known = self.observer.target()?;
        let newer = known.revision;
        (known.target.is_some() && newer > revision)
            .then(|| format!("the target of revision {newer} took the place of this one"))
    }

    /// How many modules are live, and which of them do not show that they stand and wait for a target.
    pub(crate) fn restless(&self, now: Duration) -> (usize, Vec<ModuleId>) {
        let live = self
            .heartbeats
            .values()
            .filter(|(_, arrived)| now.saturating_sub(*arrived) < LIVE);
        let restless = live.clone().filter(|(heartbeat, _)| {
            !matches!(
                heartbeat.phase,
                ModulePhase::Listening | ModulePhase::WaitingForQuorum
            )
        });
        let restless = restless.map(|(heartbeat, _)| heartbeat.module).collect();
        (live.count(), restless)
    }

    /// Announces this from now on.
    pub(crate) fn announce(&mut self, now: Duration, announcement: TargetAnnouncement) {
        let announcement = Arc::new(announcement);
        self.observer
            .handle(now, &Message::Target(Arc::clone(&announcement)));
        self.own = Some(announcement);
    }

    /// The same, under a revision of at least `fresh` that takes precedence over all others; returns that revision.
    pub(crate) fn announce_above_all(
        &mut self,
        now: Duration,
        fresh: u64,
        announcement: TargetAnnouncement,
    ) -> Result<u64, String> {
        let revision = self.next_revision(fresh)?;
        let announcement = TargetAnnouncement {
            revision,
            ..announcement
        };
        self.announce(now, announcement);
        Ok(revision)
    }

    /// The answer to a client that asks for the status.
    pub(crate) fn answer(&self, request: QueryStatusRequest) -> QueryStatusResponse {
        let mut progress = Progress::from(&self.observer.progress());
        if !request.include_waiting {
            progress.waiting_for.clear();
        }
        let target = self.observer.target();
        QueryStatusResponse {
            target: target.map_or_else(String::new, |target| target.name.clone()),
            revision: target.map_or(0, |target| target.revision),
            progress,
        }
    }

    /// Withdraws the current target, which any publisher may have announced, if it has the revision that is meant; 0 means
    /// any. `fresh` is a revision for now. Says what was withdrawn, or why nothing was.
    pub(crate) fn withdraw(
        &mut self,
        now: Duration,
        fresh: u64,
        meant: u64,
    ) -> Result<String, String> {
        let Some(known) = self.observer.target() else {
            return Err("no target was announced".to_owned());
        };
        let revision = known.revision;
        if known.target.is_none() {
            return Err(format!("revision {revision} withdrew the target already"));
        }
        if meant != 0 && meant != revision {
            return Err(format!("revision {revision} holds, not {meant}"));
        }
        let withdrawal = TargetAnnouncement {
            target: None,
            ..(**known).clone()
        };
        let withdrew = format!("withdrew `{}`", withdrawal.name);
        self.announce_above_all(now, fresh, withdrawal)?;
        Ok(withdrew)
    }

    /// A revision greater than all that were announced.
    fn next_revision(&self, fresh: u64) -> Result<u64, String> {
        let known = self.observer.target().map_or(0, |known| known.revision);
        let next = known.checked_add(1).ok_or_else(|| {
            format!("revision {known} is the greatest there is, so none takes precedence over it")
        })?;
        Ok(fresh.max(next))
    }
}

#[cfg(test)]
mod tests {
    use formation_model::Scenario;

    use super::*;

    const SCENARIO: &str = "
name: pair
target: {spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}], edges: [[1, 2]]}
singletons: [{id: 1, x: 3.0, y: 9.5}, {id: 2, x: 0.0, y: 0.0}]
";
    const NOW: Duration = Duration::from_secs(1);

    fn announcement(revision: u64) -> TargetAnnouncement {
        let scenario = Scenario::from_yaml(SCENARIO).unwrap();
        TargetAnnouncement {
            name: scenario.name().to_owned(),
            expected_modules: Some(2),
            ..TargetAnnouncement::new(scenario.problem(), revision)
        }
    }

    fn withdraw(status: &mut FormationStatus, revision: u64) -> Result<String, String> {
        status.withdraw(NOW, 100, revision)
    }

    #[test]
    fn a_withdrawal_is_what_is_announced_from_then_on() {
        let mut status = FormationStatus::default();
        assert_eq!(
            withdraw(&mut status, 0),
            Err("no target was announced".to_owned())
        );
        status.announce(NOW, announcement(7));
        assert_eq!(
            withdraw(&mut status, 8),
            Err("revision 7 holds, not 8".to_owned())
        );
        assert_eq!(withdraw(&mut status, 7), Ok("withdrew `pair`".to_owned()));
        let own = status.own().unwrap();
        assert_eq!((own.revision, own.target.is_none()), (100, true));
        assert_eq!(
            withdraw(&mut status, 0),
            Err("revision 100 withdrew the target already".to_owned())
        );
        let answer = status.answer(QueryStatusRequest::default());
        assert_eq!(answer.progress.stage, Progress::STAGE_WAITING_FOR_TARGET);
    }

    #[test]
    fn a_withdrawal_takes_precedence_over_what_another_publisher_announced() {
        let mut status = FormationStatus::default();
        status.announce(NOW, announcement(7));
        status.handle_message(NOW, &Message::Target(Arc::new(announcement(500))));
        let answer = status.answer(QueryStatusRequest::default());
        assert_eq!((answer.target.as_str(), answer.revision), ("pair", 500));
        assert!(withdraw(&mut status, 7).is_err());
        assert!(withdraw(&mut status, 500).is_ok());
        assert_eq!(status.own().unwrap().revision, 501);
        status.handle_message(NOW, &Message::Target(Arc::new(announcement(u64::MAX))));
        assert!(withdraw(&mut status, 0).unwrap_err().contains("greatest"));
    }
}
