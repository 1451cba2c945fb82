//! The limits of one formation. Input beyond them is refused.

use crate::MicroUnits;

/// The most modules that take part in one formation.
pub const MODULES_MAX: usize = 10_000;
/// The most turns of one plan: a module takes at most one in its configuration, and one more if it leaves that.
pub const TURNS_MAX: u32 = 20_000;
/// The most spots of one target.
pub const SPOTS_MAX: usize = 10_000;
/// The most edges of one target.
pub const EDGES_MAX: usize = 40_000;
/// The most modules that are docked to one module.
pub const LINKS_MAX: usize = 64;
/// A module that was moved by more than this while its process did not run no longer stands where it settled: an eighth of a
/// unit.
pub const RETENTION_DISTANCE: MicroUnits = MicroUnits(125_000);
/// How far a time stamp of another process may be ahead of the own clock, in microseconds: 142 years, as clocks that were never
/// set start in 1970.
pub const STAMP_AHEAD_MAX: u64 = 1 << 52;
/// The most bytes of the name of a formation or of a frame.
pub const NAME_BYTES_MAX: usize = 255;
