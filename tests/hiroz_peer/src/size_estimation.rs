//! What the generated code expects of the crate that includes it.

/// How large a message may become on the wire.
pub trait SizeEstimation {
    fn estimated_cdr_size(&self) -> usize;
}
