//! Reading a recording, as far as it is intact.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use mcap::McapResult;
use mcap::read::{ChannelAccumulator, parse_record};
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::file::{LOSSES, LOST};

/// A longer record is taken to be damaged.
const RECORD_BYTES_MAX: usize = 256 << 20;

/// A sample of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// The fully qualified name of the topic.
    pub topic: &'a str,
    /// The type of the topic, such as `std_msgs/msg/Header`; empty if the file does not say.
    pub type_name: &'a str,
    /// When it arrived, in nanoseconds since 1970.
    pub received_ns: u64,
    /// CDR, with the four bytes in front that name its byte order.
    pub bytes: &'a [u8],
}

/// What a file says apart from its samples.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileSummary {
    /// The number of samples.
    pub samples: u64,
    /// Why the file could not be read to its end.
    pub damage: Option<String>,
    /// How many samples the recorder lost, if it finished the file.
    pub lost: Option<u64>,
}

/// Reads a file, and gives each of its samples to `visit`, in the order in which they were written.
///
/// A file that is damaged or has no end is read up to the first chunk that is not intact.
///
/// # Errors
/// The file cannot be opened, or is no MCAP file.
pub fn read(path: &Path, visit: impl FnMut(Recorded<'_>)) -> io::Result<FileSummary> {
    let mut file = File::open(path)?;
    let mut reader = Reader {
        visit,
        channels: ChannelAccumulator::default(),
        is_mcap: false,
        summary: FileSummary::default(),
    };
    let damage = reader.read(&mut file)?;
    if let Some(damage) = &damage
        && !reader.is_mcap
    {
        return Err(io::Error::other(format!("is no MCAP file: {damage}")));
    }
    Ok(FileSummary {
        damage,
        ..reader.summary
    })
}

struct Reader<F> {
    visit: F,
    channels: ChannelAccumulator<'static>,
    /// Whether its first record was read.
    is_mcap: bool,
    summary: FileSummary,
}

impl<F: FnMut(Recorded<'_>)> Reader<F> {
    /// Reads to the end, or to what is damaged, which it returns.
    fn read(&mut self, file: &mut File) -> io::Result<Option<String>> {
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(RECORD_BYTES_MAX);
        let mut reader = LinearReader::new_with_options(options);
        while let Some(event) = reader.next_event() {
            let taken = match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    let count = file.read(reader.insert(wanted))?;
                    reader.notify_read(count);
                    continue;
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    parse_record(opcode, data).and_then(|record| self.take(record))
                }
                Err(error) => Err(error),
            };
            if let Err(error) = taken {
                return Ok(Some(error.to_string()));
            }
        }
        Ok(None)
    }

    fn take(&mut self, record: Record<'_>) -> McapResult<()> {
        self.is_mcap = true;
        match record {
            Record::Schema { header, data } => self.channels.add_schema_from_slice(header, &data),
            Record::Channel(channel) => self.channels.add_channel(channel),
            Record::Message { header, data } => {
                let Some(channel) = self.channels.get(header.channel_id) else {
                    return Err(mcap::McapError::UnknownChannel(
                        header.sequence,
                        header.channel_id,
                    ));
                };
                self.summary.samples += 1;
                let schema = channel.schema.as_ref();
                (self.visit)(Recorded {
                    topic: &channel.topic,
                    type_name: schema.map_or("", |schema| &schema.name),
                    received_ns: header.log_time,
                    bytes: &data,
                });
                Ok(())
            }
            Record::Metadata(metadata) if metadata.name == LOSSES => {
                let lost = metadata.metadata.get(LOST);
                self.summary.lost = lost.and_then(|count| count.parse().ok());
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::file::RecordingFile;
    use crate::file::tests::{interfaces, sample, topic};

    const SAMPLES: u64 = 20;
    const SAMPLES_PER_CHUNK: u64 = 5;

    /// A recording of several chunks.
    fn recording(path: &Path) -> Vec<u8> {
        let mut file = RecordingFile::create(path, interfaces()).unwrap();
        for sequence in 1..=SAMPLES {
            file.write(&topic(), &sample(sequence)).unwrap();
            if sequence % SAMPLES_PER_CHUNK == 0 {
                file.flush().unwrap();
            }
        }
        file.finish(0).unwrap();
        fs::read(path).unwrap()
    }

    #[test]
    fn a_file_that_is_cut_anywhere_is_read_up_to_the_last_whole_chunk() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.mcap");
        let whole = recording(&path);
        let mut before = 0;
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let mut count = 0;
            match read(&path, |_| count += 1) {
                Ok(summary) => {
                    assert!(summary.damage.is_some(), "{length}");
                    assert_eq!(count % SAMPLES_PER_CHUNK, 0, "{length}");
                    assert!(count >= before, "{length}");
                    before = count;
                }
                Err(error) => {
                    assert!(before == 0, "{length}");
                    assert!(error.to_string().starts_with("is no MCAP file"), "{error}");
                }
            }
        }
        assert_eq!(before, SAMPLES);
    }

    #[test]
    fn a_changed_byte_of_a_sample_is_damage() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.mcap");
        let mut bytes = recording(&path);
        // A sample of the third chunk.
        let payload = sample(12).bytes;
        let at = bytes
            .windows(payload.len())
            .position(|window| window == payload)
            .unwrap();
        bytes[at + 5] ^= 0x40;
        fs::write(&path, bytes).unwrap();
        let mut count = 0;
        let summary = read(&path, |_| count += 1).unwrap();
        assert_eq!(count, 10);
        let damage = summary.damage.unwrap();
        assert!(damage.starts_with("Chunk CRC failed"), "{damage}");
    }

    #[test]
    fn a_file_of_another_format_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text.mcap");
        fs::write(&path, "name: no recording\n".repeat(10)).unwrap();
        let error = read(&path, |_| {}).unwrap_err().to_string();
        assert_eq!(error, "is no MCAP file: Bad magic number");
    }
}
