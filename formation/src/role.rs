//! The roles of the programs of a formation, each with a certificate of its own, and the files that hold these.

use std::path::{Path, PathBuf};

/// What a process does in a formation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Hosts modules, or drives their robots.
    Module,
    /// Announces targets.
    Publisher,
    /// Judges the formation.
    Verifier,
    /// Commands modules, and calls services and actions.
    Operator,
    /// Records or draws the formation.
    Observer,
}

/// The common name of routers.
pub const ROUTER: &str = "router";

impl Role {
    /// All roles.
    pub const ALL: [Self; 5] = [
        Self::Module,
        Self::Publisher,
        Self::Verifier,
        Self::Operator,
        Self::Observer,
    ];

    /// The common name of its certificate.
    pub fn name(self) -> &'static str {
        match self {
            Self::Module => "module",
            Self::Publisher => "publisher",
            Self::Verifier => "verifier",
            Self::Operator => "operator",
            Self::Observer => "observer",
        }
    }

    /// The role in which the launcher starts a program. What it does not know drives robots.
    pub fn of(program: &Path) -> Self {
        match program.file_name().and_then(|name| name.to_str()) {
            Some("target_publisher") => Self::Publisher,
            Some("verifier") => Self::Verifier,
            Some("recorder") => Self::Observer,
            _ => Self::Module,
        }
    }
}

/// The file that `formation security create` makes for a role, or for routers.
pub fn file_of(directory: &Path, name: &str) -> PathBuf {
    directory.join(format!("{name}.json5"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_have_the_roles_of_their_tasks() {
        let role = |name: &str| Role::of(&Path::new("/opt/formation").join(name));
        assert_eq!(role("target_publisher"), Role::Publisher);
        assert_eq!(role("verifier"), Role::Verifier);
        assert_eq!(role("recorder"), Role::Observer);
        for name in ["module_agent", "leader_agent", "world", "sh"] {
            assert_eq!(role(name), Role::Module, "{name}");
        }
    }
}
