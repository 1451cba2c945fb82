//! The judgement of a formation.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::breach::Breach;
use super::causality::Acts;
use super::claims::Claimed;
use super::end_state::EndState;
use super::observation::Observer;
use super::received::split;
use super::record::PlannedEpoch;
use super::verdict::{CollisionRisk, Counts, Outcome, Timings, Verdict};
use crate::violation::{Missing, VIOLATIONS_MAX, Violation};
use formation_model::{ModuleId, SpotId};

impl Observer {
    /// The verdict at this time; `None` if the formation is neither done nor failed.
    /// Enforces V1.
    pub(super) fn judge(&mut self, now: Duration) -> Option<Verdict> {
        self.note_stop(now);
        self.judge_at(now, now >= self.time_limit())
    }

    /// The limit starts again with a command to stop, and with the command to resume.
    pub(super) fn note_stop(&mut self, now: Duration) {
        if self.is_stopped() {
            self.limit_from = *self.stopped_since.get_or_insert(now);
        } else if self.stopped_since.take().is_some() {
            self.limit_from = now;
        }
    }

    /// The verdict at this time; if the time is up, whatever is missing.
    pub(super) fn judge_at(&mut self, now: Duration, is_late: bool) -> Option<Verdict> {
        let missing = self.missing(now);
        let is_last = is_late && !self.is_reviewed;
        let patience = match missing.is_empty() {
            _ if is_last => Some(Duration::ZERO),
            true => Some(self.parameters.grace),
            false => is_late.then_some(self.parameters.silence),
        };
        let waits = patience.is_some_and(|patience| self.settle_bodies(now, patience));
        if !missing.is_empty() {
            (self.reached_since, self.breach) = (None, None);
            return is_late.then(|| self.report(now, missing, None));
        }
        let since = *self.reached_since.get_or_insert(now);
        let is_settled = now >= since.saturating_add(self.parameters.grace);
        let mut verdict = self.report(now, missing, Some(since));
        if verdict.violations.is_empty() {
            self.breach = None;
        } else {
            // What was whole may have been pushed apart: that is no breach if the modules mend it, and that has to be heard.
            let mut breach = self.breach.unwrap_or(Breach::found_at(now));
            if !self.hears_members(now) {
                breach = breach.unheard_at(now);
            }
            self.breach = Some(breach);
            let is_final = is_last || now >= breach.reported_at(&self.parameters);
            return is_final.then_some(verdict);
        }
        if waits && !is_settled {
            // Modules may have run into each other, unless a state shows otherwise that is on its way.
            return None;
        }
        let is_final = is_late || is_settled;
        let is_whole = verdict.open_spots.is_empty();
        verdict.outcome = match is_whole {
            _ if !verdict.unjudged.is_empty() => Outcome::NotJudged,
            true => Outcome::Complete,
            false => Outcome::Partial,
        };
        if is_whole {
            return Some(verdict);
        }
        let members = verdict.assignments.len() + verdict.unassigned.len();
        let is_short = self.expected_count().is_some_and(|count| members < count);
        (is_final || !is_short).then_some(verdict)
    }

    /// Judges what met modules that stood where they were last seen, if no other state of them has come within `patience`. Returns
    /// whether one is waited for.
    pub(super) fn settle_bodies(&mut self, now: Duration, patience: Duration) -> bool {
        let newest = self.received.newest();
        let out_of_sight = newest.map_or_else(BTreeSet::new, |planned| {
            EndState::new(&self.received, planned).out_of_sight(now, self.parameters.silence)
        });
        self.received.bodies.settle(now, patience, &out_of_sight)
    }

    /// Whether the members of the newest roster are to stand still, by the latest command that any of them shows.
    pub(super) fn is_stopped(&self) -> bool {
        let members = self.received.newest().map(|planned| planned.members());
        let members = members.into_iter().flatten();
        let latest = members.filter_map(|member| {
            let record = self.received.modules.get(&member.module.id)?;
            Some(record.run_of(member.incarnation)?.stop)
        });
        latest.max().is_some_and(|stop| stop.stopped)
    }

    /// What the target in force still lacks.
    pub(super) fn missing(&self, now: Duration) -> Vec<Missing> {
        let Some(planned) = self.received.current() else {
            return self.missing_roster();
        };
        let mut missing = EndState::new(&self.received, planned).missing();
        missing.extend(self.silent(now, planned));
        if !missing.is_empty() {
            missing.extend(self.is_stopped().then_some(Missing::Resumption));
            missing.extend(self.absent().map(|module| Missing::Module { module }));
            missing.extend(self.waited_for_by_given(&missing));
        }
        missing
    }

    /// The modules that are silent or absent and without which the target's allocation cannot be carried out.
    fn waited_for_by_given(&self, missing: &[Missing]) -> Vec<Missing> {
        let target = self.target().and_then(|target| target.target.as_ref());
        let Some(given) = target.and_then(|target| target.given()) else {
            return Vec::new();
        };
        let lost = missing.iter().filter_map(|one| match *one {
            Missing::Silent { module, .. } | Missing::Module { module } => Some(module),
            _ => None,
        });
        lost.filter(|module| given.spots().contains_key(module))
            .map(|module| Missing::Given { module })
            .collect()
    }

    /// The members whose last heartbeat is too old.
    /// Enforces V2.
    fn silent(&self, now: Duration, planned: PlannedEpoch<'_>) -> impl Iterator<Item = Missing> {
        self.silent_for(self.parameters.silence, now, planned)
    }

    /// The members whose last heartbeat is older than this.
    fn silent_for(
        &self,
        silence: Duration,
        now: Duration,
        planned: PlannedEpoch<'_>,
    ) -> impl Iterator<Item = Missing> {
        planned.members().iter().filter_map(move |member| {
            let module = member.module.id;
            let record = self.received.modules.get(&module)?;
            let (_, last) = record.run_of(member.incarnation)?.last_heartbeat?;
            (now.saturating_sub(last) > silence).then_some(Missing::Silent { module, silence })
        })
    }

    /// Whether a member of the plan in force is silent.
    pub(super) fn has_silent_member(&self, now: Duration) -> bool {
        let planned = self.received.current();
        planned.is_some_and(|planned| self.silent(now, planned).next().is_some())
    }

    /// Whether all members of the plan in force were heard within half of the silence that is granted to them. One that is stopped for
    /// longer, and is then cut off, may have had no time to say what it does.
    fn hears_members(&self, now: Duration) -> bool {
        let planned = self.received.current();
        planned.is_none_or(|planned| {
            let silence = self.parameters.silence / 2;
            self.silent_for(silence, now, planned).next().is_none()
        })
    }

    fn missing_roster(&self) -> Vec<Missing> {
        let absent = self.absent().map(|module| Missing::Module { module });
        let mut missing: Vec<Missing> = absent.collect();
        let joined = self.received.modules.len();
        if let Some(expected) = self.expected_count().filter(|&expected| joined < expected) {
            missing.push(Missing::Modules { joined, expected });
        }
        missing.extend(self.waited_for_by_given(&missing));
        missing.push(match self.target() {
            None => Missing::Target,
            Some(target) if target.target.is_none() => Missing::WithdrawnTarget,
            Some(target) => Missing::Roster {
                revision: target.revision,
            },
        });
        missing
    }

    /// The report on the current state. Its outcome is FAILED; the caller raises it if the state proves better. `completed`
    /// is the time at which the end state was reached.
    pub(super) fn report(
        &self,
        now: Duration,
        missing: Vec<Missing>,
        completed: Option<Duration>,
    ) -> Verdict {
        let epochs = self.received.with_roster();
        let mut verdict = Verdict {
            outcome: Outcome::Failed,
            epoch: None,
            filled_spots: 0,
            open_spots: Vec::new(),
            blocked_spots: Vec::new(),
            assignments: BTreeMap::new(),
            unassigned: Vec::new(),
            violations: self.received.retired.clone(),
            missing,
            timings: Timings {
                completed,
                ..Timings::default()
            },
            counts: Counts {
                epochs: epochs.clone().count(),
                messages: self.received.messages,
                dropped: self.received.dropped,
                segments: self.received.bodies.segments,
                missed_states: self.received.bodies.missed(),
                unproven: self.received.unproven,
                ..Counts::default()
            },
            collision_risk: None,
            unjudged: self.received.bodies.unjudged.clone(),
        };
        let current = self.received.current();
        for (epoch, record) in epochs {
            let mut violations = self.received.violations_in(epoch, record);
            if current.is_none_or(|current| current.epoch != epoch) {
                let (shown, unproven) = split(violations);
                verdict.counts.unproven += unproven;
                violations = shown;
            }
            verdict.violations.extend(violations);
        }
        let is_news = |violation: &Violation| !self.reported.contains(violation);
        verdict.violations.retain(is_news);
        if let Some(planned) = current {
            self.report_on(now, planned, &mut verdict);
        }
        verdict.collision_risk = verdict.violations.iter().find_map(|one| match *one {
            Violation::BodiesOverlap {
                epoch,
                first,
                second,
                ..
            } => Some(CollisionRisk {
                epoch,
                first,
                second,
            }),
            _ => None,
        });
        verdict.violations.sort();
        verdict.violations.dedup();
        verdict.violations.truncate(VIOLATIONS_MAX);
        verdict
    }

    /// Adds the end state of the current epoch to a report.
    fn report_on(&self, now: Duration, planned: PlannedEpoch<'_>, verdict: &mut Verdict) {
        let end = EndState::new(&self.received, planned);
        let claimed = &end.claimed;
        verdict.epoch = Some(planned.epoch);
        verdict.assignments = end.filled();
        let filled: BTreeSet<SpotId> = verdict.assignments.values().copied().collect();
        // The whole target: the problem leaves out the spots that bodies block.
        let target = planned.roster.roster.target.target.iter();
        let spots = target.flat_map(|target| target.spots()).map(|spot| spot.id);
        let modules = planned.problem.modules().iter().map(|module| module.id);
        verdict.filled_spots = filled.len();
        verdict.open_spots = spots.filter(|spot| !filled.contains(spot)).collect();
        verdict.blocked_spots = planned.roster.roster.blocked_spots();
        verdict.unassigned = modules
            .filter(|module| !verdict.assignments.contains_key(module))
            .collect();
        verdict.timings.roster_known = Some(planned.roster.received);
        verdict.timings.last_claim = claimed.last_received;
        verdict.timings.first_moving = first_moving(planned);
        verdict.counts.claims = usize::try_from(claimed.turns).unwrap_or(usize::MAX);
        verdict.counts.pairs = claimed.replay.pairs;
        verdict.counts.evictions = claimed.replay.evictions;
        verdict.counts.detached = claimed.replay.detached.len();
        if verdict.timings.completed.is_some() {
            let violations = &mut verdict.violations;
            violations.extend(end.violations(now, &self.parameters));
            violations.extend(unit_violations(&Acts::new(planned), claimed));
        } else {
            let unclaimed = |spot: &&SpotId| !claimed.replay.holders.contains_key(spot);
            let open = verdict.open_spots.iter().filter(unclaimed);
            let missing = open.map(|&spot| Missing::Spot { spot });
            verdict.missing.extend(missing);
        }
        let announced = &planned.roster.roster.target;
        let target_differs = self.target().is_some_and(|target| {
            target.revision == announced.revision && target.target != announced.target
        });
        if target_differs {
            let epoch = planned.epoch;
            verdict.violations.push(Violation::TargetDiffers { epoch });
        }
    }
}

impl Verdict {
    /// Whether the verdict differs from another in nothing worth reporting. The list of what a failed formation lacks does not
    /// count, since it changes all the time.
    pub(super) fn says_the_same_as(&self, other: &Self) -> bool {
        let is_unfinished = self.outcome == Outcome::Failed;
        self.outcome == other.outcome
            && self.violations == other.violations
            && (is_unfinished
                || (self.epoch == other.epoch
                    && self.assignments == other.assignments
                    && self.unassigned == other.unassigned))
    }
}

/// Modules that moved as one unit must have been placed as one block.
fn unit_violations(acts: &Acts<'_>, claimed: &Claimed) -> Vec<Violation> {
    let blocks: BTreeSet<&Vec<ModuleId>> = claimed.replay.blocks.iter().collect();
    // A block that does not get to its spots as one body moves as single modules.
    let units = acts.units.iter();
    units
        .filter(|(lead, unit)| {
            let is_single = unit.modules.len() == 1;
            !(is_single || blocks.contains(&unit.modules)) || unit.modules.first() != Some(lead)
        })
        .map(|(&lead, _)| Violation::WrongUnit { lead })
        .collect()
}

/// When the first message of a moving or settled module that was not pinned was received.
fn first_moving(planned: PlannedEpoch<'_>) -> Option<Duration> {
    let members = planned.members().iter();
    members
        .filter(|member| member.module.pin.is_none())
        .filter_map(|member| planned.act_of(member)?.moved_received)
        .min()
}
