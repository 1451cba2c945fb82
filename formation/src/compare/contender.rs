//! What is compared.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::Policy;
use ros_runtime::exit::Failure;

use crate::arguments::CompareArguments;

/// A policy under the name that rows have for it.
#[derive(Clone, Debug)]
pub struct ComparedPolicy {
    pub label: String,
    pub decides: Decides,
}

/// Who decides.
#[derive(Clone, Debug)]
pub enum Decides {
    Policy(Policy),
    /// A shell command, and the time that it has.
    Program(String, Duration),
}

impl ComparedPolicy {
    /// All that are compared; the others are compared with the first.
    ///
    /// # Errors
    /// Names one that is listed twice.
    pub fn all(arguments: &CompareArguments) -> Result<Vec<Self>, Failure> {
        let policies = arguments.policy.iter().map(|policy| Self {
            label: policy.name().to_owned(),
            decides: Decides::Policy(*policy),
        });
        let limit = arguments.program_timeout;
        let programs = arguments.policy_program.iter().map(|program| Self {
            label: program.name.clone(),
            decides: Decides::Program(program.command.clone(), limit),
        });
        let all: Vec<Self> = policies.chain(programs).collect();
        let mut labels = BTreeSet::new();
        match all.iter().find(|one| !labels.insert(&one.label)) {
            Some(twice) => Err(Failure::bad_input(format_args!(
                "the policy `{}` is listed twice",
                twice.label
            ))),
            None => Ok(all),
        }
    }
}
