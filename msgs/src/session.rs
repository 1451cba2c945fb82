//! Sessions and versions: which messages belong together at all.

use std::fmt;

use formation_model::ModuleSize;

use crate::claim::{Eviction, SpotClaim};
use crate::heartbeat::Heartbeat;
use crate::module_state::ModuleStates;
use crate::operator::OperatorCommand;
use crate::roster::Roster;
use crate::target::TargetConfiguration;
use crate::verdict::Verdict;

/// Distinguishes formations that follow each other, or stand side by side, on one domain. The programs of one formation have the
/// same; messages of another session change nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SessionId(pub u64);

impl SessionId {
    /// The session of commands that apply to every session.
    pub const EVERY: Self = Self(0);
}

impl fmt::Display for SessionId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "session {}", self.0)
    }
}

/// A message that belongs to a session.
pub trait InSession: Sized {
    /// Its session.
    fn session(&self) -> SessionId;

    /// The size of modules that it states; one metre if it states none that is valid.
    fn module_size(&self) -> ModuleSize {
        ModuleSize::METRE
    }

    /// Puts the message into a session.
    #[must_use]
    fn in_session(self, session: SessionId) -> Self;
}

macro_rules! in_session {
    ($($message:ty $(, |$sized:ident| $metres:expr)?);+ $(;)?) => {
        $(impl InSession for $message {
            fn session(&self) -> SessionId {
                SessionId(self.session)
            }

            $(fn module_size(&self) -> ModuleSize {
                let $sized = self;
                ModuleSize::from_metres($metres).unwrap_or_default()
            })?

            fn in_session(mut self, session: SessionId) -> Self {
                self.session = session.0;
                self
            }
        })+
    };
}

in_session!(
    Eviction;
    Heartbeat, |own| own.module_size;
    ModuleStates, |own| own.module_size;
    OperatorCommand;
    Roster, |own| own.target.module_size;
    SpotClaim;
    TargetConfiguration, |own| own.module_size;
    Verdict;
);
