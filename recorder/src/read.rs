//! Reading a recording, as far as it is intact.

use std::io::{self, Read};
use std::path::Path;

use mcap::McapResult;
use mcap::read::{ChannelAccumulator, parse_record};
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::bag;
use crate::chunk::{RECORD_BYTES_MAX, for_each_record};
use crate::file::{LOSSES, LOST};

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

/// What a recording says apart from its samples.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileSummary {
    /// The number of samples.
    pub samples: u64,
    /// Why it could not be read to its end.
    pub damage: Option<String>,
    /// How many samples the recorder lost, if it finished its files.
    pub lost: Option<u64>,
}

/// Reads a recording, and gives each of its samples to `visit`, in the order in which they were written.
///
/// It is an MCAP file, which zstd may have compressed as a whole, or the folder of a bag with such files. What is damaged or has
/// no end is read up to the first chunk that is not intact.
///
/// # Errors
/// It cannot be opened, or is no MCAP file, and no bag of such files.
pub fn read(path: &Path, visit: impl FnMut(Recorded<'_>)) -> io::Result<FileSummary> {
    let files = bag::files(path)?;
    let is_bag = path.is_dir();
    let mut reader = Reader {
        visit,
        channels: ChannelAccumulator::default(),
        is_mcap: false,
        chunks: 0,
        summary: FileSummary::default(),
    };
    for file in files {
        // A bag is damaged where one of its files is missing.
        let source = match bag::open(&file) {
            Err(error) if !is_bag => return Err(error),
            source => source.map_err(|error| format!("cannot be opened: {error}")),
        };
        let is_opened = source.is_ok();
        let damage = source.and_then(|mut source| reader.read(&mut *source));
        let Err(damage) = damage else {
            continue;
        };
        let damage = if is_bag {
            let name = file.file_name().unwrap_or_default();
            format!("{}: {damage}", name.display())
        } else {
            damage
        };
        if !reader.is_mcap && is_opened {
            return Err(io::Error::other(format!("is no MCAP file: {damage}")));
        }
        if !reader.is_mcap {
            return Err(io::Error::other(damage));
        }
        reader.summary.damage = Some(damage);
        break;
    }
    Ok(reader.summary)
}

struct Reader<F> {
    visit: F,
    /// Those of the present file.
    channels: ChannelAccumulator<'static>,
    /// Whether the first record of any file was read.
    is_mcap: bool,
    /// How many chunks of the present file were begun.
    chunks: u64,
    summary: FileSummary,
}

impl<F: FnMut(Recorded<'_>)> Reader<F> {
    /// Reads a file to its end, or to what is damaged, which is the error.
    fn read(&mut self, file: &mut dyn Read) -> Result<(), String> {
        self.channels = ChannelAccumulator::default();
        self.chunks = 0;
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_record_length_limit(RECORD_BYTES_MAX);
        let mut reader = LinearReader::new_with_options(options);
        while let Some(event) = reader.next_event() {
            match event.map_err(|error| error.to_string())? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let count = file.read(reader.insert(wanted));
                    reader.notify_read(count.map_err(|error| error.to_string())?);
                }
                LinearReadEvent::Record { opcode, data } => {
                    let record = parse_record(opcode, data).map_err(|error| error.to_string())?;
                    self.take_from_file(record)?;
                }
            }
        }
        Ok(())
    }

    fn take_from_file(&mut self, record: Record<'_>) -> Result<(), String> {
        let Record::Chunk { header, data } = record else {
            return self.take(record).map_err(|error| error.to_string());
        };
        self.is_mcap = true;
        self.chunks += 1;
        for_each_record(&header, &data, |record| {
            self.take(record).map_err(|error| error.to_string())
        })
        .map_err(|reason| format!("chunk {}: {reason}", self.chunks))
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
                if let Some(lost) = lost.and_then(|count| count.parse::<u64>().ok()) {
                    let before = self.summary.lost.unwrap_or(0);
                    self.summary.lost = Some(before.saturating_add(lost));
                }
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
        assert!(damage.starts_with("chunk 3: Chunk CRC failed"), "{damage}");
    }

    #[test]
    fn a_file_of_another_format_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text.mcap");
        fs::write(&path, "name: no recording\n".repeat(10)).unwrap();
        let error = read(&path, |_| {}).unwrap_err().to_string();
        assert_eq!(error, "is no MCAP file: Bad magic number");
    }

    /// A bag of `ros2 bag`: its second file is compressed as a whole.
    fn bag(folder: &Path) {
        let second = recording(&folder.join("run_1.mcap"));
        fs::remove_file(folder.join("run_1.mcap")).unwrap();
        recording(&folder.join("run_0.mcap"));
        let level = ruzstd::encoding::CompressionLevel::Fastest;
        // The frames of a file that was written in parts.
        let (begin, end) = second.split_at(second.len() / 2);
        let frames = [begin, end].map(|part| ruzstd::encoding::compress_to_vec(part, level));
        fs::write(folder.join("run_1.mcap.zstd"), frames.concat()).unwrap();
        describe(folder, "mcap", "FILE", &["run_0.mcap", "run_1.mcap.zstd"]);
    }

    fn describe(folder: &Path, storage: &str, mode: &str, files: &[&str]) {
        let text = format!(
            "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: {storage}\n  duration:\n    nanoseconds: 1\n  \
             compression_format: zstd\n  compression_mode: {mode}\n  relative_file_paths: {files:?}\n"
        );
        fs::write(folder.join("metadata.yaml"), text).unwrap();
    }

    fn counted(path: &Path) -> (u64, FileSummary) {
        let mut count = 0;
        let summary = read(path, |_| count += 1).unwrap();
        assert_eq!(summary.samples, count);
        (count, summary)
    }

    fn refused(path: &Path) -> String {
        read(path, |_| {}).unwrap_err().to_string()
    }

    #[test]
    fn a_bag_is_read_file_by_file_also_without_its_description() {
        let folder = tempfile::tempdir().unwrap();
        bag(folder.path());
        let expected = FileSummary {
            samples: 2 * SAMPLES,
            damage: None,
            lost: Some(0),
        };
        assert_eq!(counted(folder.path()), (2 * SAMPLES, expected.clone()));
        let (alone, _) = counted(&folder.path().join("run_1.mcap.zstd"));
        assert_eq!(alone, SAMPLES);
        fs::remove_file(folder.path().join("metadata.yaml")).unwrap();
        assert_eq!(counted(folder.path()), (2 * SAMPLES, expected));
    }

    #[test]
    fn files_without_a_description_come_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["run_10.mcap", "run_9.mcap", "run_0.mcap", "notes.txt"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let files = bag::files(folder.path()).unwrap();
        let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap()).collect();
        assert_eq!(names, ["run_0.mcap", "run_9.mcap", "run_10.mcap"]);
    }

    #[test]
    fn a_file_of_a_bag_that_is_damaged_or_missing_is_named_and_what_comes_before_is_read() {
        let folder = tempfile::tempdir().unwrap();
        bag(folder.path());
        let second = folder.path().join("run_1.mcap.zstd");
        let mut bytes = fs::read(&second).unwrap();
        bytes.truncate(bytes.len() - 9);
        fs::write(&second, &bytes).unwrap();
        let (count, summary) = counted(folder.path());
        assert!(count >= SAMPLES);
        let damage = summary.damage.unwrap();
        assert!(damage.starts_with("run_1.mcap.zstd: "), "{damage}");
        assert!(
            damage.contains("cannot be decompressed by zstd"),
            "{damage}"
        );
        fs::remove_file(&second).unwrap();
        let (count, summary) = counted(folder.path());
        assert_eq!(count, SAMPLES);
        let damage = summary.damage.unwrap();
        assert!(
            damage.starts_with("run_1.mcap.zstd: cannot be opened: "),
            "{damage}"
        );
    }

    #[test]
    fn a_folder_that_cannot_be_read_is_refused_by_what_it_has() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        assert_eq!(refused(path), "is a folder without a file of MCAP");
        for (storage, mode, file, reason) in [
            (
                "sqlite3",
                "\"\"",
                "a.db3",
                "the storage is `sqlite3`, and only mcap",
            ),
            (
                "mcap",
                "MESSAGE",
                "a.mcap",
                "each message is compressed on its own",
            ),
            (
                "mcap",
                "\"\"",
                "../a.mcap",
                "`../a.mcap` is not in the folder",
            ),
            (
                "mcap",
                "\"\"",
                "/etc/passwd",
                "`/etc/passwd` is not in the folder",
            ),
            ("mcap", "\"\"", "a.mcap", "a.mcap: cannot be opened"),
        ] {
            describe(path, storage, mode, &[file]);
            let error = refused(path);
            assert!(error.contains(reason), "{error}");
        }
        fs::write(path.join("metadata.yaml"), "name: something else").unwrap();
        assert!(
            refused(path).starts_with("metadata.yaml: "),
            "{}",
            refused(path)
        );
    }
}
