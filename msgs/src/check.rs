//! The checks that several messages share.

use std::collections::BTreeSet;
use std::fmt;

use formation_model::{
    Digest, Epoch, MicroUnits, ModuleId, ModuleSize, NO_ID, Pose, PoseError, TURNS_MAX,
};

use crate::bounds::{COORDINATE_LIMIT_MICRO, LINKS_MAX, MODULES_MAX, NAME_BYTES_MAX};
use crate::error::{Fault, MessageError};

/// A fault and the path of its field, while the topic is not yet known.
#[derive(Debug)]
pub(crate) struct FieldError {
    field: String,
    fault: Fault,
}

impl FieldError {
    pub(crate) fn new(field: impl Into<String>, fault: impl Into<Fault>) -> Self {
        Self {
            field: field.into(),
            fault: fault.into(),
        }
    }

    /// Two fields contradict each other.
    pub(crate) fn contradiction(field: impl Into<String>, reason: &'static str) -> Self {
        Self::new(field, Fault::Contradiction(reason))
    }

    /// A number that has no meaning here.
    pub(crate) fn unknown(field: &str, value: impl Into<i64>, known: &'static str) -> Self {
        let value = value.into();
        Self::new(field, Fault::UnknownValue { value, known })
    }

    /// Prefixes the field with `outer`, the field of the message around it.
    pub(crate) fn within(mut self, outer: impl fmt::Display) -> Self {
        self.field = if self.field.is_empty() {
            outer.to_string()
        } else {
            format!("{outer}.{}", self.field)
        };
        self
    }

    /// Prefixes the field with an entry of the list `outer`.
    pub(crate) fn within_entry(self, outer: &str, index: usize) -> Self {
        self.within(format_args!("{outer}[{index}]"))
    }

    pub(crate) fn on(self, topic: &'static str) -> MessageError {
        MessageError {
            topic,
            field: self.field,
            fault: self.fault,
        }
    }
}

pub(crate) type Checked<T> = Result<T, FieldError>;

pub(crate) fn count(field: &str, count: usize, limit: usize) -> Checked<()> {
    if count > limit {
        return Err(FieldError::new(field, Fault::TooMany { count, limit }));
    }
    Ok(())
}

pub(crate) fn name(field: &str, text: &str) -> Checked<()> {
    length(field, text, NAME_BYTES_MAX)
}

/// A text of at most `limit` bytes.
pub(crate) fn length(field: &str, text: &str, limit: usize) -> Checked<()> {
    let bytes = text.len();
    if bytes > limit {
        return Err(FieldError::new(field, Fault::TooLong { bytes, limit }));
    }
    Ok(())
}

/// A number of at most `limit`.
pub(crate) fn at_most(field: &str, value: u64, limit: u64) -> Checked<()> {
    if value > limit {
        return Err(FieldError::new(field, Fault::TooGreat { value, limit }));
    }
    Ok(())
}

/// The number of a turn, from 0.
pub(crate) fn turn(turn: u32) -> Checked<u32> {
    at_most("turn", turn.into(), (TURNS_MAX - 1).into())?;
    Ok(turn)
}

/// Lists that must be empty, for this reason.
pub(crate) fn empty(lists: &[(&str, usize)], reason: &'static str) -> Checked<()> {
    match lists.iter().find(|(_, length)| *length > 0) {
        Some(&(field, _)) => Err(FieldError::contradiction(field, reason)),
        None => Ok(()),
    }
}

/// An identifier that must name something.
pub(crate) fn id<T>(field: &str, raw: u32, make: impl Fn(u32) -> T) -> Checked<T> {
    optional_id(raw, make).ok_or_else(|| FieldError::new(field, Fault::ReservedId))
}

/// An identifier that may stand for none.
pub(crate) fn optional_id<T>(raw: u32, make: impl Fn(u32) -> T) -> Option<T> {
    (raw != NO_ID).then(|| make(raw))
}

/// A pose that is given in metres and radians.
pub(crate) fn pose((x, y): (f64, f64), theta: f64, size: ModuleSize) -> Checked<Pose> {
    size.pose_from_metres(x, y, theta)
        .map_err(|PoseError { coordinate, source }| FieldError::new(coordinate, source))
}

pub(crate) fn micro(field: &str, raw: i64) -> Checked<MicroUnits> {
    if raw.unsigned_abs() > COORDINATE_LIMIT_MICRO.unsigned_abs() {
        return Err(FieldError::new(field, Fault::MicroOutOfRange(raw)));
    }
    Ok(MicroUnits(raw))
}

/// The links of one module: each once, none to itself.
pub(crate) fn links(of: ModuleId, raw: &[u32]) -> Checked<BTreeSet<ModuleId>> {
    count("links", raw.len(), LINKS_MAX)?;
    let mut links = BTreeSet::new();
    for (index, &raw_id) in raw.iter().enumerate() {
        let fail = |fault| FieldError::new(format!("links[{index}]"), fault);
        let other = id("", raw_id, ModuleId).map_err(|error| error.within_entry("links", index))?;
        if other == of {
            return Err(fail(Fault::Itself(of.to_string())));
        }
        if !links.insert(other) {
            return Err(fail(Fault::Repeated(other.to_string())));
        }
    }
    Ok(links)
}

/// A digest and the flag that says whether there is one.
pub(crate) fn digest(epoch: Option<Epoch>, has_digest: bool, raw: u64) -> Checked<Option<Digest>> {
    let contradiction = |reason| Err(FieldError::contradiction("digest", reason));
    match (has_digest, epoch) {
        (false, _) if raw != 0 => contradiction("must be 0 while has_digest is false"),
        (true, None) => contradiction("there cannot be one without an epoch"),
        (true, Some(_)) => Ok(Some(Digest(raw))),
        (false, _) => Ok(None),
    }
}

/// Fails at the first entry that does not stand after the one before it.
pub(crate) fn ascending<T: Ord + fmt::Display>(
    field: &str,
    entries: impl IntoIterator<Item = T>,
) -> Checked<()> {
    let mut last: Option<T> = None;
    for (index, entry) in entries.into_iter().enumerate() {
        if let Some(last) = &last
            && entry <= *last
        {
            let fault = if entry == *last {
                Fault::Repeated(entry.to_string())
            } else {
                Fault::NotAscending(last.to_string(), entry.to_string())
            };
            return Err(FieldError::new(format!("{field}[{index}]"), fault));
        }
        last = Some(entry);
    }
    Ok(())
}

/// Fails at the first entry that was there before.
pub(crate) fn distinct<T: Ord + fmt::Display>(
    field: &str,
    entries: impl IntoIterator<Item = T>,
) -> Checked<()> {
    let mut seen = BTreeSet::new();
    for (index, entry) in entries.into_iter().enumerate() {
        if seen.contains(&entry) {
            let fault = Fault::Repeated(entry.to_string());
            return Err(FieldError::new(format!("{field}[{index}]"), fault));
        }
        seen.insert(entry);
    }
    Ok(())
}

/// The entries of a list of at most `limit`, each validated.
pub(crate) fn entries<R, T>(
    field: &str,
    raw: &[R],
    limit: usize,
    validate: impl Fn(&R) -> Checked<T>,
) -> Checked<Vec<T>> {
    count(field, raw.len(), limit)?;
    let entries = raw.iter().enumerate();
    entries
        .map(|(index, entry)| validate(entry).map_err(|error| error.within_entry(field, index)))
        .collect()
}

/// The version of the protocol that this library speaks. It rises when modules of two builds could not agree on a plan.
pub const PROTOCOL_VERSION: u32 = 9;

/// The version of the protocol of a message.
/// Enforces C6.
pub(crate) fn version(version: u32) -> Checked<()> {
    if version == PROTOCOL_VERSION {
        return Ok(());
    }
    let fault = Fault::OtherVersion {
        version,
        ours: PROTOCOL_VERSION,
    };
    Err(FieldError::new("protocol_version", fault))
}

/// The size of modules that a message states, which is that of the receiver.
pub(crate) fn module_size(metres: f64, ours: ModuleSize) -> Checked<()> {
    if ModuleSize::from_metres(metres) == Ok(ours) {
        return Ok(());
    }
    let fault = Fault::OtherModuleSize { metres, ours };
    Err(FieldError::new("module_size", fault))
}

/// Ascending identifiers of modules.
pub(crate) fn module_ids(field: &str, raw: &[u32], limit: usize) -> Checked<Vec<ModuleId>> {
    let modules = entries(field, raw, limit, |&raw_id| id("", raw_id, ModuleId))?;
    ascending(field, modules.iter().copied())?;
    Ok(modules)
}

/// As many modules as a formation may have, in ascending order.
pub(crate) fn modules(field: &str, raw: &[u32]) -> Checked<BTreeSet<ModuleId>> {
    Ok(module_ids(field, raw, MODULES_MAX)?.into_iter().collect())
}
