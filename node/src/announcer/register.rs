//! What is announced, by this process and by others, and how far modules have come with it. It knows no DDS.

use std::sync::Arc;
use std::time::Duration;

use formation::message::{Message, TargetAnnouncement};
use formation::verify::{Observer, ObserverParameters};
use formation_msgs::{
    Progress, QueryStatusRequest, QueryStatusResponse, WithdrawTargetRequest,
    WithdrawTargetResponse,
};

/// What is announced, and how far modules have come with it.
pub(super) struct Register {
    /// What this process announced last.
    own: Option<Arc<TargetAnnouncement>>,
    observer: Observer,
}

impl Register {
    /// Nothing is announced yet.
    pub(super) fn new() -> Self {
        Self {
            own: None,
            observer: Observer::new(ObserverParameters::default()),
        }
    }

    /// What this process has to announce, if anything: whatever it announced last, a withdrawal included.
    pub(super) fn own(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.own.as_ref()
    }

    /// Takes in what others say.
    pub(super) fn hear(&mut self, now: Duration, message: &Message) {
        self.observer.handle(now, message);
    }

    /// From now on this is what the process announces.
    pub(super) fn announce(&mut self, now: Duration, announcement: TargetAnnouncement) {
        let announcement = Arc::new(announcement);
        self.observer
            .handle(now, &Message::Target(Arc::clone(&announcement)));
        self.own = Some(announcement);
    }

    /// How far the formation has come.
    pub(super) fn status(&self, request: QueryStatusRequest) -> QueryStatusResponse {
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

    /// Withdraws the target that holds, whoever announced it; `fresh` is the revision of what is announced now.
    pub(super) fn withdraw(
        &mut self,
        now: Duration,
        fresh: u64,
        request: WithdrawTargetRequest,
    ) -> WithdrawTargetResponse {
        match self.withdrawal(fresh, request.revision) {
            Ok(withdrawal) => {
                let message = format!("withdrew `{}`", withdrawal.name);
                self.announce(now, withdrawal);
                WithdrawTargetResponse {
                    success: true,
                    message,
                }
            }
            Err(message) => WithdrawTargetResponse {
                success: false,
                message,
            },
        }
    }

    /// What withdraws the target that holds, if it is the one that is meant; 0 means any.
    fn withdrawal(&self, fresh: u64, meant: u64) -> Result<TargetAnnouncement, String> {
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
        Ok(TargetAnnouncement {
            revision: self.next_revision(fresh)?,
            target: None,
            ..(**known).clone()
        })
    }

    /// A revision that outweighs all that were announced.
    fn next_revision(&self, fresh: u64) -> Result<u64, String> {
        let known = self.observer.target().map_or(0, |known| known.revision);
        let next = known.checked_add(1).ok_or_else(|| {
            format!("revision {known} is the greatest there is, so nothing outweighs it")
        })?;
        Ok(fresh.max(next))
    }
}

#[cfg(test)]
mod tests {
    use formation::scenario::Scenario;

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
            revision,
            name: scenario.name().to_owned(),
            target: Some(Arc::clone(scenario.problem().target())),
            parameters: *scenario.problem().parameters(),
            expected_modules: Some(2),
        }
    }

    fn withdraw(register: &mut Register, revision: u64) -> Result<String, String> {
        let response = register.withdraw(NOW, 100, WithdrawTargetRequest { revision });
        if response.success {
            Ok(response.message)
        } else {
            Err(response.message)
        }
    }

    #[test]
    fn a_withdrawal_is_what_is_announced_from_then_on() {
        let mut register = Register::new();
        assert_eq!(
            withdraw(&mut register, 0),
            Err("no target was announced".to_owned())
        );
        register.announce(NOW, announcement(7));
        assert_eq!(
            withdraw(&mut register, 8),
            Err("revision 7 holds, not 8".to_owned())
        );
        assert_eq!(withdraw(&mut register, 7), Ok("withdrew `pair`".to_owned()));
        let own = register.own().unwrap();
        assert_eq!((own.revision, own.target.is_none()), (100, true));
        assert_eq!(
            withdraw(&mut register, 0),
            Err("revision 100 withdrew the target already".to_owned())
        );
        let status = register.status(QueryStatusRequest::default());
        assert_eq!(status.progress.stage, Progress::STAGE_WAITING_FOR_TARGET);
    }

    #[test]
    fn what_another_announced_is_outweighed_too() {
        let mut register = Register::new();
        register.announce(NOW, announcement(7));
        register.hear(NOW, &Message::Target(Arc::new(announcement(500))));
        let status = register.status(QueryStatusRequest::default());
        assert_eq!((status.target.as_str(), status.revision), ("pair", 500));
        assert!(withdraw(&mut register, 7).is_err());
        assert!(withdraw(&mut register, 500).is_ok());
        assert_eq!(register.own().unwrap().revision, 501);
        register.hear(NOW, &Message::Target(Arc::new(announcement(u64::MAX))));
        assert!(withdraw(&mut register, 0).unwrap_err().contains("greatest"));
    }
}
