//! Whatever bytes arrive, reading and checking them never panics.

use std::sync::LazyLock;

use crate::common::cases;
use crate::common::codec::{self, Codec};
use crate::common::samples::{longest_of, samples};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

struct Subject {
    codec: Codec,
    valid: Vec<u8>,
}

static SUBJECTS: LazyLock<Vec<Subject>> = LazyLock::new(|| {
    let all = samples(20);
    codec::all()
        .into_iter()
        .map(|codec| Subject {
            valid: longest_of(&all, &codec.full_name()),
            codec,
        })
        .collect()
});

/// Reads, checks, and where reading works writes again: what was read once is read alike ever after.
fn try_all(codec: &Codec, bytes: &[u8]) {
    (codec.accept)(bytes);
    if let Ok(decoded) = (codec.decode)(bytes) {
        let again = (codec.decode)(&decoded.bytes).map(|again| again.bytes);
        assert_eq!(again, Ok(decoded.bytes), "{}", codec.full_name());
    }
}

proptest! {
    #![proptest_config(cases(2_000))]

    #[test]
    fn arbitrary_bytes(mut bytes in vec(any::<u8>(), 0..400), little_endian in any::<bool>()) {
        if let Some(head) = bytes.first_chunk_mut::<4>() {
            *head = [0, u8::from(little_endian), 0, 0];
        }
        for subject in &*SUBJECTS {
            try_all(&subject.codec, &bytes);
        }
    }

    /// Mostly zeroes, so that flags are flags and lengths are small: these get much further.
    #[test]
    fn sparse_bytes(length in 4..600_usize, set in vec((any::<Index>(), any::<u8>()), 0..30)) {
        let mut bytes = vec![0; length];
        for (index, value) in set {
            bytes[index.index(length)] = value;
        }
        bytes[..4].copy_from_slice(&[0, 1, 0, 0]);
        for subject in &*SUBJECTS {
            try_all(&subject.codec, &bytes);
        }
    }

    #[test]
    fn damaged_messages(
        damage in vec((any::<Index>(), any::<u8>()), 0..4),
        cut in prop::option::weighted(0.3, any::<Index>()),
    ) {
        for subject in &*SUBJECTS {
            let mut bytes = subject.valid.clone();
            for (index, value) in &damage {
                let offset = 4 + index.index(bytes.len() - 4);
                bytes[offset] = *value;
            }
            if let Some(cut) = &cut {
                bytes.truncate(4 + cut.index(bytes.len() - 4));
            }
            try_all(&subject.codec, &bytes);
        }
    }
}

#[test]
fn what_is_cut_off_is_refused() {
    for Subject { codec, valid } in &*SUBJECTS {
        assert!((codec.accept)(valid), "{}", codec.full_name());
        for length in 0..valid.len() {
            assert!(
                (codec.decode)(&valid[..length]).is_err(),
                "{} of {length} bytes",
                codec.full_name()
            );
        }
    }
}
