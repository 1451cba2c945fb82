//! What can be wrong with a message.

use formation_model::{
    self as model, CutPriceError, MICRO_PER_UNIT, ModuleId, ModuleSize, NO_ID, OptionRefused,
    ProblemError, QuantiseError, SpotId, SpreadError, WeightsError,
};
use thiserror::Error;

use crate::bounds::COORDINATE_LIMIT_MICRO;

/// A message that was refused: where it came, which field is wrong, and why.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{topic}: {}{fault}", prefix(.field))]
pub struct MessageError {
    /// The topic's own name, before any remapping.
    pub topic: &'static str,
    /// The path of the field, such as `modules[3].links[0]`; empty when the whole message is wrong.
    pub field: String,
    /// What is wrong with it.
    pub fault: Fault,
}

fn prefix(field: &str) -> String {
    if field.is_empty() {
        String::new()
    } else {
        format!("{field}: ")
    }
}

/// What is wrong with one field.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Fault {
    /// A coordinate is no number that can be used.
    #[error(transparent)]
    Quantise(#[from] QuantiseError),
    /// A quantised coordinate is out of range.
    #[error(
        "must lie within +-{COORDINATE_LIMIT_MICRO}, {MICRO_PER_UNIT} to the unit or radian, got {0}"
    )]
    MicroOutOfRange(i64),
    /// A list is longer than its bound.
    #[error("{count} entries, at most {limit} are allowed")]
    TooMany {
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A string is longer than its bound.
    #[error("{bytes} bytes, at most {limit} are allowed")]
    TooLong {
        /// How many there are.
        bytes: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A number is above its bound.
    #[error("must be at most {limit}, got {value}")]
    TooGreat {
        /// The number.
        value: u64,
        /// The greatest that is allowed.
        limit: u64,
    },
    /// An identifier that must name something is the one that stands for none.
    #[error("{NO_ID} stands for none and cannot be used here")]
    ReservedId,
    /// An enumerated field holds a number that stands for nothing.
    #[error("{value} is unknown; known are {known}")]
    UnknownValue {
        /// The number.
        value: i64,
        /// The names and numbers that are known.
        known: &'static str,
    },
    /// A field holds a name that stands for nothing.
    #[error("`{name}` is unknown; known are {known}")]
    UnknownName {
        /// The name.
        name: String,
        /// The names that are known.
        known: &'static str,
    },
    /// A policy has no such option, or the option no such value.
    #[error(transparent)]
    PolicyOption(#[from] OptionRefused),
    /// A policy has no options.
    #[error("the policy `{0}` has no options")]
    NoOptions(&'static str),
    /// The sender speaks another version of the protocol.
    #[error("is {version}, but this program speaks version {ours}; run the same build everywhere")]
    OtherVersion {
        /// The sender's version.
        version: u32,
        /// The version of this program.
        ours: u32,
    },
    /// The sender's modules have another size.
    #[error("is {metres} m, but the modules of this node measure {ours}; give all nodes the same")]
    OtherModuleSize {
        /// The sender's size.
        metres: f64,
        /// The size of this node's modules.
        ours: ModuleSize,
    },
    /// An epoch is needed, but the one given is number 0.
    #[error("number 0 stands for no epoch, but one is needed here")]
    NoEpoch,
    /// A list holds an entry twice.
    #[error("{0} is listed twice")]
    Repeated(String),
    /// A list that must ascend does not.
    #[error("{0} must stand after {1}, the list ascends")]
    NotAscending(String, String),
    /// A module is related to itself in a way that none can be.
    #[error("names {0} itself")]
    Itself(String),
    /// An eviction sends a module to the spot that it loses.
    #[error("sends the evicted module back to {0}, which it loses")]
    BackToLostSpot(SpotId),
    /// Two fields contradict each other.
    #[error("{0}")]
    Contradiction(&'static str),
    /// The topic belongs to another module.
    #[error("{0} has a topic of its own")]
    WrongModule(ModuleId),
    /// Four numbers do not make a rotation.
    #[error("is no rotation: its length must be 1, got {0}")]
    NoRotation(f64),
    /// A pose is given in another frame than all others.
    #[error("must be `{wanted}`, the frame of all poses, got `{given}`")]
    WrongFrame {
        /// The frame that it is given in.
        given: String,
        /// The frame that is needed.
        wanted: String,
    },
    /// The target is wrong; the text begins with its field.
    #[error(transparent)]
    Target(#[from] model::FieldError),
    /// The weights are wrong.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The price of cuts is wrong.
    #[error(transparent)]
    CutPrice(#[from] CutPriceError),
    /// The spread is wrong.
    #[error(transparent)]
    Spread(#[from] SpreadError),
    /// The members of a roster do not fit its target or each other.
    #[error(transparent)]
    Problem(#[from] ProblemError),
}
