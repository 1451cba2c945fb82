//! Whatever bytes arrive, reading and checking them takes no more memory than a small multiple of them.

mod common;

use common::codec::{self, Codec};
use common::samples::{longest_of, samples};
use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// How much memory reading may take for each byte that arrived, the temporary copies of growing lists included. An
/// empty string is four bytes on the wire and twenty-four in memory, and the last growth of a list holds one and a
/// half times its content, up to twice as large as needed.
const AMPLIFICATION_MAX: usize = 24;
/// What an error's text and the like may take besides.
const MARGIN_BYTES: usize = 2_048;

/// The most memory that reading and checking took beyond what was in use before, in bytes.
fn memory_of(codec: &Codec, bytes: &[u8]) -> usize {
    ALLOCATOR.reset_peak_usage();
    let before = ALLOCATOR.current_usage();
    (codec.accept)(bytes);
    ALLOCATOR.peak_usage().saturating_sub(before)
}

fn check_memory(codec: &Codec, bytes: &[u8], what: &str) -> usize {
    let (used, allowed) = (
        memory_of(codec, bytes),
        AMPLIFICATION_MAX * bytes.len() + MARGIN_BYTES,
    );
    assert!(
        used <= allowed,
        "{} {what}: {} bytes took {used} bytes of memory, more than {allowed}",
        codec.full_name(),
        bytes.len()
    );
    used
}

/// The only test of this program, because a concurrent one would count into the same peak.
#[test]
fn memory_stays_in_proportion_to_what_arrived() {
    let all = samples(20);
    for codec in codec::all() {
        let valid = longest_of(&all, &codec.full_name());
        assert!((codec.decode)(&valid).is_ok(), "{}", codec.full_name());
        check_memory(&codec, &valid, "as it should be");
        // Every place where a length may stand claims a huge one.
        for offset in (4..valid.len().saturating_sub(3)).step_by(4) {
            for length in [
                u32::MAX,
                u32::MAX - 1,
                i32::MAX.unsigned_abs(),
                10_001,
                1 << 24,
            ] {
                let mut bytes = valid.clone();
                bytes[offset..offset + 4].copy_from_slice(&length.to_le_bytes());
                check_memory(&codec, &bytes, "with a huge length");
            }
        }
        // A megabyte of the least that an entry can be.
        for offset in (4..valid.len().min(400).saturating_sub(3)).step_by(4) {
            let mut bytes = valid[..offset].to_vec();
            bytes.extend(u32::MAX.to_le_bytes());
            bytes.resize(1 << 20, 0);
            check_memory(
                &codec,
                &bytes,
                "with a huge length and a megabyte of zeroes",
            );
        }
    }
}
