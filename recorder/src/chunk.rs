//! The records of a chunk, decompressed.

use std::borrow::Cow;
use std::io::Read;

use lz4_flex::frame::FrameDecoder as Lz4Decoder;
use mcap::McapError;
use mcap::read::parse_record;
use mcap::records::{ChunkHeader, Record};
use ruzstd::decoding::FrameDecoder as ZstdDecoder;

/// The most bytes of a record, and of a chunk that is decompressed.
pub(crate) const RECORD_BYTES_MAX: usize = 256 << 20;
/// In front of each record in a chunk: its kind, in one byte, and its length, in eight.
const PREFIX_BYTES: usize = 9;

/// Gives each record of a chunk to `take`, once the whole chunk has proved to be intact.
///
/// # Errors
/// Says what is wrong with the chunk, or passes on what `take` says.
pub(crate) fn for_each_record(
    header: &ChunkHeader,
    data: &[u8],
    mut take: impl FnMut(Record<'_>) -> Result<(), String>,
) -> Result<(), String> {
    let content = decompressed(header, data)?;
    let calculated = crc32fast::hash(&content);
    if header.uncompressed_crc != 0 && header.uncompressed_crc != calculated {
        let saved = header.uncompressed_crc;
        return Err(McapError::BadChunkCrc { saved, calculated }.to_string());
    }
    let mut left = &*content;
    while !left.is_empty() {
        let (opcode, body, rest) = split_record(left).ok_or("ends within a record".to_owned())?;
        left = rest;
        let record = parse_record(opcode, body).map_err(|error| error.to_string())?;
        take(record)?;
    }
    Ok(())
}

/// The kind and the body of the first record, and what follows it.
fn split_record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (prefix, rest) = bytes.split_at_checked(PREFIX_BYTES)?;
    let (&opcode, length) = prefix.split_first()?;
    let length = u64::from_le_bytes(length.try_into().ok()?);
    let (body, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    Some((opcode, body, rest))
}

/// The content of a chunk, which has the size that its header says.
fn decompressed<'a>(header: &ChunkHeader, data: &'a [u8]) -> Result<Cow<'a, [u8]>, String> {
    let size = usize::try_from(header.uncompressed_size).ok();
    let size = size
        .filter(|&size| size <= RECORD_BYTES_MAX)
        .ok_or_else(|| {
            format!(
                "would have {} bytes, and {RECORD_BYTES_MAX} are the most that are read",
                header.uncompressed_size
            )
        })?;
    let content = match header.compression.as_str() {
        "" => Cow::Borrowed(data),
        "zstd" => Cow::Owned(of_zstd(data, size)?),
        "lz4" => Cow::Owned(of_lz4(data, size)?),
        other => {
            return Err(format!(
                "is compressed by `{other}`; zstd and lz4 can be read"
            ));
        }
    };
    if content.len() != size {
        let length = content.len();
        return Err(format!("has {length} bytes, and {size} by its header"));
    }
    Ok(content)
}

fn of_zstd(data: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let mut content = vec![0; size];
    let decoded = ZstdDecoder::new().decode_all(data, &mut content);
    let length = decoded.map_err(|error| format!("cannot be decompressed by zstd: {error}"))?;
    content.truncate(length);
    Ok(content)
}

fn of_lz4(data: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let mut content = Vec::new();
    // One byte more shows that there is too much.
    let most = u64::try_from(size).unwrap_or(u64::MAX).saturating_add(1);
    let decoded = Lz4Decoder::new(data).take(most).read_to_end(&mut content);
    decoded.map_err(|error| format!("cannot be decompressed by lz4: {error}"))?;
    Ok(content)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use lz4_flex::frame::FrameEncoder;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};

    use super::*;

    /// The content of a chunk with two records of kinds that applications define.
    fn content() -> Vec<u8> {
        let mut content = Vec::new();
        for body in [&[7_u8; 300][..], b"end"] {
            content.push(0x80);
            content.extend(u64::try_from(body.len()).unwrap().to_le_bytes());
            content.extend(body);
        }
        content
    }

    fn compressed(compression: &str, content: &[u8]) -> (ChunkHeader, Vec<u8>) {
        let data = match compression {
            "zstd" => compress_to_vec(content, CompressionLevel::Fastest),
            "lz4" => {
                let mut encoder = FrameEncoder::new(Vec::new());
                encoder.write_all(content).unwrap();
                encoder.finish().unwrap()
            }
            _ => content.to_vec(),
        };
        let header = ChunkHeader {
            message_start_time: 0,
            message_end_time: 0,
            uncompressed_size: u64::try_from(content.len()).unwrap(),
            uncompressed_crc: crc32fast::hash(content),
            compression: compression.to_owned(),
            compressed_size: u64::try_from(data.len()).unwrap(),
        };
        (header, data)
    }

    /// How many records there are.
    fn records(header: &ChunkHeader, data: &[u8]) -> Result<usize, String> {
        let mut count = 0;
        for_each_record(header, data, |_| {
            count += 1;
            Ok(())
        })?;
        Ok(count)
    }

    #[test]
    fn chunks_are_read_whatever_compressed_them() {
        for compression in ["", "zstd", "lz4"] {
            let (header, data) = compressed(compression, &content());
            assert_eq!(records(&header, &data), Ok(2), "{compression}");
        }
        let (header, data) = compressed("brotli", &content());
        let error = records(&header, &data).unwrap_err();
        assert_eq!(error, "is compressed by `brotli`; zstd and lz4 can be read");
    }

    /// None of its records is given out.
    #[test]
    fn a_chunk_with_any_byte_changed_or_cut_is_damaged() {
        for compression in ["", "zstd", "lz4"] {
            let (header, data) = compressed(compression, &content());
            for at in 0..data.len() {
                let mut changed = data.clone();
                changed[at] ^= 0x10;
                for spoilt in [&changed, &data[..at]] {
                    let mut count = 0;
                    let read = for_each_record(&header, spoilt, |_| {
                        count += 1;
                        Ok(())
                    });
                    // A byte of a compressed chunk may say nothing of the content, such as the mark at the end.
                    assert!(read.is_err() || !compression.is_empty(), "{at}");
                    let expected = if read.is_ok() { 2 } else { 0 };
                    assert_eq!(count, expected, "{compression} {at}");
                }
            }
            let (header, data) = compressed(compression, &content());
            assert!(records(&header, &data[..data.len() / 2]).is_err());
        }
    }

    #[test]
    fn a_chunk_of_another_size_than_its_header_says_is_damaged() {
        for compression in ["", "zstd", "lz4"] {
            let content = content();
            let (header, data) = compressed(compression, &content);
            for size in [0, content.len() - 1, content.len() + 1] {
                let header = ChunkHeader {
                    uncompressed_size: u64::try_from(size).unwrap(),
                    ..header.clone()
                };
                assert!(records(&header, &data).is_err(), "{compression} {size}");
            }
            let header = ChunkHeader {
                uncompressed_size: u64::MAX,
                ..header
            };
            let error = records(&header, &data).unwrap_err();
            assert!(error.contains("are the most that are read"), "{error}");
        }
    }

    #[test]
    fn a_chunk_that_ends_within_a_record_is_damaged() {
        let whole = content();
        let (header, data) = compressed("", &whole[..whole.len() - 1]);
        assert_eq!(
            records(&header, &data),
            Err("ends within a record".to_owned())
        );
    }
}
