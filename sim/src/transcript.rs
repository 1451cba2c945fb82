//! What happened in a run, as a sequence of normalised events.
//!
//! A line names the module that acts, the kind of the event, and its data. The words are this module's own: a message to
//! people that is reworded elsewhere changes no transcript. Times, planning durations and digests are left out, so that
//! two runs have equal transcripts if the same things happened in the same order.

use std::fmt::{self, Display, Write as _};
use std::time::Duration;

use formation_model::text::joined;
use formation_model::{
    AssemblyWarning, BlockedSpot, BodyReport, Epoch, Message, ModuleId, Roster, RosterMember,
    RosterMessage, Service, SpotClaim, SpotId, Whereabouts,
};
use formation_protocol::{Command, EpochReason, Event, Shortfall};

use crate::faults::Fault;
use crate::observation::Observation;

/// One event of a transcript.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TranscriptLine {
    /// When it happened, by the cluster's clock; no part of the normalised event.
    pub at: Duration,
    /// The normalised event.
    pub event: String,
}

impl Display for TranscriptLine {
    /// Writes the event with its time in front, for people.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{:>9.3} s  {}",
            self.at.as_secs_f64(),
            self.event
        )
    }
}

/// The events of a run in the order of their times.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Transcript(Vec<TranscriptLine>);

impl Transcript {
    /// The events in order.
    #[must_use]
    pub fn lines(&self) -> &[TranscriptLine] {
        &self.0
    }

    /// The normalised events, one a line, without times.
    #[must_use]
    pub fn events(&self) -> String {
        self.0.iter().fold(String::new(), |mut text, line| {
            text.push_str(&line.event);
            text.push('\n');
            text
        })
    }

    /// Adds an observation, unless it repeats without news, such as a heartbeat.
    pub(crate) fn add(&mut self, at: Duration, observation: &Observation) {
        let (actor, entry) = match observation {
            Observation::Published(module, message) => (Some(module), published(message)),
            Observation::Noted(module, event) => (Some(module), Some(noted(event))),
            Observation::SetOff(..)
            | Observation::Stands(..)
            | Observation::Carried(..)
            | Observation::Torn(_)
            | Observation::Injected(_) => (None, None),
            Observation::Announced(announcement) => {
                let kind = match announcement.target {
                    Some(_) => "target_announced",
                    None => "target_withdrawn",
                };
                let entry = Entry::of(kind).with("revision", announcement.revision);
                (None, Some(entry))
            }
            Observation::Fault(fault) => (None, Some(fault_entry(fault))),
        };
        if let Some(Entry(text)) = entry {
            let actor = actor.map_or("-".to_owned(), |module| module.0.to_string());
            let event = format!("{actor:>3} {text}");
            self.0.push(TranscriptLine { at, event });
        }
    }
}

impl Display for Transcript {
    /// Writes one line for each event, with its time in front.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0
            .iter()
            .try_for_each(|line| writeln!(formatter, "{line}"))
    }
}

/// The kind of an event and its data.
struct Entry(String);

impl Entry {
    fn of(kind: &str) -> Self {
        Self(kind.to_owned())
    }

    fn with(mut self, key: &str, value: impl Display) -> Self {
        // Writing to a string cannot fail.
        let _ = write!(self.0, " {key}={value}");
        self
    }

    fn epoch(self, epoch: Epoch) -> Self {
        let text = format!("{}.{}", epoch.number, epoch.convener.0);
        self.with("epoch", text)
    }

    fn module(self, module: ModuleId) -> Self {
        self.with("module", module.0)
    }

    fn modules(self, key: &str, modules: &[ModuleId]) -> Self {
        self.with(key, list(modules.iter().map(|module| module.0)))
    }

    fn spot(self, key: &str, spot: Option<SpotId>) -> Self {
        match spot {
            Some(spot) => self.with(key, spot.0),
            None => self.with(key, "none"),
        }
    }

    fn spots(self, spots: &[SpotId]) -> Self {
        self.with("spots", list(spots.iter().map(|spot| spot.0)))
    }

    fn millis(self, key: &str, duration: Duration) -> Self {
        self.with(key, duration.as_millis())
    }
}

fn list(items: impl IntoIterator<Item = impl Display>) -> String {
    let text = joined(items, ",");
    if text.is_empty() {
        "none".to_owned()
    } else {
        text
    }
}

fn published(message: &Message) -> Option<Entry> {
    match message {
        Message::Roster(RosterMessage::Gather {
            epoch,
            target_revision,
            ..
        }) => {
            let entry = Entry::of("gather").epoch(*epoch);
            Some(entry.with("target_revision", target_revision))
        }
        Message::Roster(RosterMessage::Plan(roster)) => Some(roster_entry(roster)),
        Message::Claim(claim) => Some(claim_entry(claim)),
        Message::Eviction(notice) => Some(
            Entry::of("eviction")
                .epoch(notice.epoch)
                .with("turn", notice.turn)
                .with("evicted", notice.eviction.evicted.0)
                .with("by", notice.eviction.by.0)
                .spot("from", Some(notice.eviction.from))
                .spot("to", notice.eviction.to),
        ),
        Message::Target(_)
        | Message::ModuleState(_)
        | Message::OtherSessionState(_)
        | Message::Heartbeat(_)
        | Message::Stop(_)
        | Message::Removal(_) => None,
    }
}

fn roster_entry(roster: &Roster) -> Entry {
    let entry = Entry::of("roster")
        .epoch(roster.epoch)
        .with("target_revision", roster.target.revision)
        .with("members", list(roster.members.iter().map(member_text)))
        .with("voters", roster.voters.named.len());
    if roster.bodies.is_empty() {
        entry
    } else {
        entry.with("bodies", list(roster.bodies.iter().map(body_text)))
    }
}

/// The module, `#` and its run unless that is the first, and whether its body was removed, stands, or may be on its way.
fn body_text(body: &BodyReport) -> String {
    let run = match body.incarnation.0 {
        0 | 1 => String::new(),
        run => format!("#{run}"),
    };
    let kind = match &body.whereabouts {
        Whereabouts::Seen(_) => "seen",
        Whereabouts::OnTheWay(_) => "on_the_way",
        Whereabouts::InBlock(_) => "in_block",
        Whereabouts::Halted(_) => "halted",
        Whereabouts::Removed => "removed",
    };
    format!("{}{run}({kind})", body.module.0)
}

/// The module, `#` and its run unless that is the first, `@` and its pin if it has one, and why it takes no spot if so.
fn member_text(member: &RosterMember) -> String {
    let mut text = member.module.id.0.to_string();
    let run = member.incarnation.0;
    // Writing to a string cannot fail.
    if run > 1 {
        let _ = write!(text, "#{run}");
    }
    if let Some(pin) = member.module.pin {
        let _ = write!(text, "@{}", pin.0);
    }
    if member.service != Service::Active {
        let _ = write!(text, "({})", service_text(member.service));
    }
    text
}

fn service_text(service: Service) -> &'static str {
    match service {
        Service::Active => "active",
        Service::Retired => "retired",
        Service::MotionFailed => "motion_failed",
    }
}

fn claim_entry(claim: &SpotClaim) -> Entry {
    let decision = &claim.decision;
    let pairs = decision.selections.iter();
    let entry = Entry::of("claim")
        .epoch(claim.epoch)
        .with("turn", claim.turn)
        .with(
            "spots",
            list(pairs.map(|pair| format!("{}:{}", pair.spot.0, pair.module.0))),
        );
    let entry = match decision.swaps.as_slice() {
        [] => entry,
        swaps => {
            let swaps = swaps.iter();
            let swaps = swaps.map(|pair| format!("{}:{}", pair.spot.0, pair.module.0));
            entry.with("swaps", list(swaps))
        }
    };
    if decision.detached.is_empty() {
        entry
    } else {
        entry.modules("detached", &decision.detached)
    }
}

fn noted(event: &Event) -> Entry {
    match event {
        Event::Convened(epoch, reason) => because(Entry::of("convened").epoch(*epoch), reason),
        Event::Gathered(epoch) => Entry::of("gathered").epoch(*epoch),
        Event::PlanningBegun { epoch, members } => {
            let entry = Entry::of("planning").epoch(*epoch);
            entry.with("members", members)
        }
        Event::Planned { epoch, turns, .. } => {
            Entry::of("planned").epoch(*epoch).with("turns", turns)
        }
        Event::WaitingForLease(wait) => {
            Entry::of("waiting_for_lease").with("span_ms", wait.as_millis())
        }
        Event::NoVoters => Entry::of("no_voters"),
        Event::Agreed(epoch) => Entry::of("agreed").epoch(*epoch),
        Event::DigestMismatch { module, .. } => Entry::of("digest_mismatch").module(*module),
        Event::PlansDiffer(sides) => plans_differ(sides.iter().map(|(_, modules)| modules)),
        Event::WaitingForQuorum(shortfall) => {
            let entry = Entry::of("waiting_for_quorum");
            match shortfall {
                Shortfall::Majority {
                    present,
                    of,
                    forgetful,
                } => {
                    let entry = entry.with("present", present).with("of", of);
                    match forgetful {
                        0 => entry,
                        count => entry.with("forgetful", count),
                    }
                }
                Shortfall::VotersUnknown => entry.with("voters", "unknown"),
            }
        }
        Event::WaitingForAgreement(modules) => {
            Entry::of("waiting_for_agreement").modules("modules", modules)
        }
        Event::AgreementLapsed(modules) => {
            Entry::of("agreement_lapsed").modules("modules", modules)
        }
        Event::Missing {
            expected,
            gathered,
            absent,
        } => Entry::of("missing")
            .with("expected", or_unknown(*expected))
            .with("gathered", gathered)
            .modules("absent", absent),
        Event::Refused { module, reason } => Entry::of("refused")
            .with("sender", or_unknown(module.map(|module| module.0)))
            .with("reason", reason.name()),
        Event::DuplicateModule(module) => Entry::of("duplicate_module").module(*module),
        Event::ClockInDoubt { module, gain } => Entry::of("clock_in_doubt")
            .module(*module)
            .millis("gain_ms", *gain),
        Event::ClockStoodStill(time) => Entry::of("clock_stood_still").millis("time_ms", *time),
        Event::RunRenumbered(_) => Entry::of("run_renumbered"),
        Event::TargetWithdrawn => Entry::of("target_withdrawn"),
        Event::MotionBegun(spot) => Entry::of("moving").spot("spot", Some(*spot)),
        Event::Settled(spot) => Entry::of("settled").spot("spot", Some(*spot)),
        Event::Spare => Entry::of("spare"),
        Event::Evicted { by, from } => {
            let entry = Entry::of("evicted").spot("from", Some(*from));
            entry.with("by", by.0)
        }
        Event::PlanOverdue(epoch) => Entry::of("plan_overdue").epoch(*epoch),
        Event::MotionOverdue(spot) => Entry::of("motion_overdue").spot("spot", *spot),
        Event::MotionFailed(spot) => Entry::of("motion_failed").spot("spot", *spot),
        Event::OffPath(distance) => Entry::of("off_path").with("distance", distance),
        Event::BackOnPath => Entry::of("back_on_path"),
        Event::PortsContradictPose(distance) => {
            Entry::of("ports_contradict_pose").with("distance", distance)
        }
        Event::LocalisationLost(deviation) => {
            Entry::of("localisation_lost").with("deviation", deviation)
        }
        Event::KeepingClear(modules) => Entry::of("keeping_clear").modules("modules", modules),
        Event::Retired => Entry::of("retired"),
        Event::Rejoined => Entry::of("rejoined"),
        Event::SpotsLeftOpen(spots) => Entry::of("spots_left_open").spots(spots),
        Event::SpotsBlocked(blocked) => blocked_spots(Entry::of("spots_blocked"), blocked),
        Event::SpotsCutOff(spots) => Entry::of("spots_cut_off").spots(spots),
        Event::MakingRoom => Entry::of("making_room"),
        Event::BodyRemoved(module) => Entry::of("body_removed").module(*module),
        Event::RemovalProposed(module) => Entry::of("removal_proposed").module(*module),
        Event::RemovalRefuted(module) => Entry::of("removal_refuted").module(*module),
        Event::RemovalOverruled(module) => Entry::of("removal_overruled").module(*module),
        Event::RemovalsHeard { epoch, modules } => Entry::of("removals_heard")
            .epoch(*epoch)
            .modules("modules", modules),
        Event::RemovalsEarly { epoch, modules } => Entry::of("removals_early")
            .epoch(*epoch)
            .modules("modules", modules),
        Event::RunRemoved(epoch) => Entry::of("run_removed").epoch(*epoch),
        Event::Stopped => Entry::of("stopped"),
        Event::Resumed => Entry::of("resumed"),
        Event::CannotReach(error) => Entry::of("cannot_reach").with("reason", error),
        Event::MayMoveAgain => Entry::of("may_move_again"),
        Event::CannotMakeWay(error) => Entry::of("cannot_make_way").with("reason", error),
        Event::InvalidStart(fault) => Entry::of("invalid_start").with("reason", fault),
        Event::NotMoving(error) => Entry::of("not_moving").with("reason", error),
        Event::GivenRefused(refused) => Entry::of("given_refused").with("reason", refused),
        Event::AssemblyWarning(warning) => acting_order(*warning),
    }
}

fn or_unknown(number: Option<u32>) -> String {
    number.map_or("unknown".to_owned(), |number| number.to_string())
}

/// Each blocked spot with the module whose body blocks it.
fn blocked_spots(entry: Entry, blocked: &[BlockedSpot]) -> Entry {
    let pairs = blocked.iter();
    entry.with(
        "spots",
        list(pairs.map(|blocked| format!("{}:{}", blocked.spot.0, blocked.module.0))),
    )
}

/// The sides come in the order of their digests, which is no part of the event.
fn plans_differ<'a>(sides: impl Iterator<Item = &'a Vec<ModuleId>>) -> Entry {
    let mut sides: Vec<String> = sides
        .map(|modules| joined(modules.iter().map(|one| one.0), "+"))
        .collect();
    sides.sort_unstable();
    Entry::of("plans_differ").with("sides", list(sides))
}

fn acting_order(warning: AssemblyWarning) -> Entry {
    let entry = Entry::of("acting_order");
    match warning {
        AssemblyWarning::WalledIn(spot) => entry.spot("walled_in", Some(spot)),
        AssemblyWarning::OffLattice => entry.with("flaw", "off_lattice"),
        AssemblyWarning::BudgetSpent => entry.with("flaw", "budget_spent"),
        AssemblyWarning::Disconnected(spot) => entry.spot("disconnected", Some(spot)),
    }
}

fn because(entry: Entry, reason: &EpochReason) -> Entry {
    let of = |kind: &str| entry.with("reason", kind);
    match reason {
        EpochReason::NewTarget => of("new_target"),
        EpochReason::DigestMismatch => of("digest_mismatch"),
        EpochReason::Left(modules) => of("left").modules("modules", modules),
        EpochReason::Silent(modules) => of("silent").modules("modules", modules),
        EpochReason::NotReceived(modules) => of("not_received").modules("modules", modules),
        EpochReason::Displaced(displaced) => {
            let named = displaced.iter();
            let named = named.map(|(module, distance)| format!("{}({distance})", module.0));
            of("displaced").with("modules", list(named))
        }
        EpochReason::Restarted(modules) => of("restarted").modules("modules", modules),
        EpochReason::Newcomers(modules) => of("newcomers").modules("modules", modules),
        EpochReason::Stuck(modules) => of("stuck").modules("modules", modules),
        EpochReason::MembersAhead(modules) => of("members_ahead").modules("modules", modules),
        EpochReason::BodiesUnlisted(modules) => of("bodies_unlisted").modules("modules", modules),
        EpochReason::RemovalsRefused(modules) => of("removals_refused").modules("modules", modules),
        EpochReason::SpotsBlocked(blocked) => blocked_spots(of("spots_blocked"), blocked),
        EpochReason::SpotsFreed(spots) => of("spots_freed").spots(spots),
        EpochReason::VotesRemoved(modules) => of("votes_removed").modules("modules", modules),
        EpochReason::BodiesGone(modules) => of("bodies_gone").modules("modules", modules),
        EpochReason::ConvenerSilent(module) => of("convener_silent").modules("modules", &[*module]),
        EpochReason::OutOfService(modules) => {
            let named = modules
                .iter()
                .map(|(module, service)| format!("{}({})", module.0, service_text(*service)));
            of("out_of_service").with("modules", list(named))
        }
    }
}

fn fault_entry(fault: &Fault) -> Entry {
    match fault {
        Fault::Crash(module) => Entry::of("crash").module(*module),
        Fault::Restart(module) => Entry::of("restart").module(*module),
        Fault::Remove { module, takes_vote } => {
            let entry = Entry::of("remove").module(*module);
            match takes_vote {
                true => entry.with("takes_vote", takes_vote),
                false => entry,
            }
        }
        Fault::Pause(module, span) => Entry::of("pause").module(*module).millis("span_ms", *span),
        Fault::Suspend(module, span) => Entry::of("suspend")
            .module(*module)
            .millis("span_ms", *span),
        Fault::Cut(aside) => {
            Entry::of("cut").with("modules", list(aside.iter().map(|module| module.0)))
        }
        Fault::Sever(links) => {
            let links = links
                .iter()
                .map(|(from, to)| format!("{}>{}", from.0, to.0));
            Entry::of("sever").with("links", list(links))
        }
        Fault::Heal => Entry::of("heal"),
        Fault::Slow { module, lag, span } => Entry::of("slow")
            .module(*module)
            .millis("lag_ms", *lag)
            .millis("span_ms", *span),
        Fault::StartLate(module) => Entry::of("start_late").module(*module),
        Fault::Command(module, command) => Entry::of(match command {
            Command::Retire => "command_retire",
            Command::Rejoin => "command_rejoin",
        })
        .module(*module),
        Fault::Stop(stop) => {
            Entry::of(if stop.stopped { "stop" } else { "resume" }).with("revision", stop.revision)
        }
        Fault::Drive { module, broken } => Entry::of(if *broken {
            "drive_broken"
        } else {
            "drive_repaired"
        })
        .module(*module),
        Fault::SetClock(module, ahead) => Entry::of("set_clock")
            .module(*module)
            .with("ahead_s", ahead.as_secs()),
        Fault::SilentDriver(module) => Entry::of("silent_driver").module(*module),
        Fault::Carry {
            module,
            with_docked,
            way,
            ..
        } => Entry::of("carry")
            .module(*module)
            .with("with_docked", with_docked)
            .with("x", way.0)
            .with("y", way.1),
        Fault::Mislead(module, way) => Entry::of("mislead")
            .module(*module)
            .with("x", way.0)
            .with("y", way.1),
        Fault::ForgeClaims => Entry::of("forge_claims"),
        Fault::ForgeRoster => Entry::of("forge_roster"),
        Fault::Withdraw => Entry::of("withdraw"),
        Fault::Announce(_) => Entry::of("announce"),
    }
}
