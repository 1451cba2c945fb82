//! The file of a recording, while it is written.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use formation_model::text::counted;
use mcap::records::{MessageHeader, Metadata};
use mcap::{WriteOptions, Writer};
use ros_runtime::RawSample;
use ros_runtime::topic::Quality;
use ros_runtime::type_hash::Interfaces;

use crate::sequence_numbers::SequenceNumbers;

/// The profile of files that ROS 2 reads.
const PROFILE: &str = "ros2";
/// The encoding of samples.
const SAMPLE_ENCODING: &str = "cdr";
/// The encoding of the definitions of types.
const DEFINITION_ENCODING: &str = "ros2msg";
/// The name of the record with what is missing from the file.
pub(crate) const LOSSES: &str = "formation_recorder";
/// The key of the number of samples that arrived faster than they could be written.
pub(crate) const LOST: &str = "lost";

/// A topic that is recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Its fully qualified name.
    pub name: String,
    /// Its type, such as `std_msgs/msg/Header`.
    pub type_name: String,
    /// What its publishers guarantee.
    pub quality: Quality,
}

/// What a finished recording holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// The number of samples.
    pub samples: u64,
    /// The samples that arrived and could not be written in time.
    pub lost: u64,
    /// By topic, the samples that did not arrive: numbers that are missing in the sequences of publishers.
    pub missing: BTreeMap<String, u64>,
}

impl fmt::Display for Written {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let samples = usize::try_from(self.samples).unwrap_or(usize::MAX);
        write!(formatter, "recorded {}", counted(samples, "sample"))?;
        if self.lost > 0 {
            write!(
                formatter,
                "; {} arrived faster than they could be written, and were lost",
                self.lost
            )?;
        }
        for (topic, missing) in &self.missing {
            write!(formatter, "; {missing} of {topic} did not arrive")?;
        }
        Ok(())
    }
}

/// A file that samples are written to.
///
/// It is readable up to the last [`Self::flush`] whatever happens to the process, and whole after [`Self::finish`].
pub struct RecordingFile<W: Write + Seek = BufWriter<File>> {
    writer: Writer<W>,
    interfaces: Interfaces,
    /// The channel of each topic that has a sample.
    channels: BTreeMap<String, u16>,
    received: Received,
    written: u64,
}

/// The most publishers of which it is kept what was received.
const PUBLISHERS_MAX: usize = 16_384;

/// What was received from each publisher.
#[derive(Debug, Default)]
struct Received {
    /// By channel and publisher, with the time of the latest sample.
    publishers: BTreeMap<(u16, u128), (SequenceNumbers, u64)>,
    /// What is missing of publishers that are no longer kept, by channel.
    missing: BTreeMap<u16, u64>,
}

impl Received {
    /// Takes in a sample; returns whether it is new. The publisher that has been silent for longest makes room for a new one.
    fn insert(&mut self, channel: u16, sample: &RawSample) -> bool {
        let publisher = (channel, sample.publisher);
        if self.publishers.len() >= PUBLISHERS_MAX && !self.publishers.contains_key(&publisher) {
            let publishers = self.publishers.iter();
            let quietest = publishers.min_by_key(|(_, (_, latest_ns))| *latest_ns);
            if let Some((&quietest, _)) = quietest
                && let Some((numbers, _)) = self.publishers.remove(&quietest)
            {
                *self.missing.entry(quietest.0).or_default() += numbers.missing();
            }
        }
        let (numbers, latest_ns) = self.publishers.entry(publisher).or_default();
        *latest_ns = sample.received_ns.max(*latest_ns);
        numbers.insert(sample.sequence)
    }

    /// How many samples did not arrive on a channel.
    fn missing(&self, channel: u16) -> u64 {
        let kept = self.publishers.range((channel, 0)..=(channel, u128::MAX));
        let gaps: u64 = kept.map(|(_, (numbers, _))| numbers.missing()).sum();
        gaps + self.missing.get(&channel).copied().unwrap_or_default()
    }
}

impl RecordingFile {
    /// Creates the file, or empties it; it can hold samples of these types.
    ///
    /// # Errors
    /// Names the file and says why it cannot be written.
    pub fn create(path: &Path, interfaces: Interfaces) -> Result<Self, String> {
        let file = File::create(path);
        let file = file.and_then(|file| Self::of(BufWriter::new(file), interfaces));
        file.map_err(|error| format!("{}: {error}", path.display()))
    }
}

impl<W: Write + Seek> RecordingFile<W> {
    fn of(out: W, interfaces: Interfaces) -> io::Result<Self> {
        let options = WriteOptions::new().compression(None).profile(PROFILE);
        let mut file = Self {
            writer: options.create(out).map_err(io::Error::other)?,
            interfaces,
            channels: BTreeMap::new(),
            received: Received::default(),
            written: 0,
        };
        file.flush()?;
        Ok(file)
    }

    /// Writes a sample, unless it is in the file already: latched samples come again when the node rejoins the graph.
    ///
    /// # Errors
    /// The type of the topic is unknown, or the file cannot be written.
    pub fn write(&mut self, topic: &RecordedTopic, sample: &RawSample) -> io::Result<()> {
        let channel_id = self.channel(topic)?;
        if !self.received.insert(channel_id, sample) {
            return Ok(());
        }
        let header = MessageHeader {
            channel_id,
            // The number wraps, as the format has no room for more.
            #[expect(clippy::cast_possible_truncation)]
            sequence: sample.sequence as u32,
            log_time: sample.received_ns,
            publish_time: sample.sent_ns.unwrap_or(sample.received_ns),
        };
        let written = self.writer.write_to_known_channel(&header, &sample.bytes);
        written.map_err(io::Error::other)?;
        self.written += 1;
        Ok(())
    }

    fn channel(&mut self, topic: &RecordedTopic) -> io::Result<u16> {
        if let Some(&channel) = self.channels.get(&topic.name) {
            return Ok(channel);
        }
        let definition = self.interfaces.definition(&topic.type_name);
        let definition = definition.map_err(io::Error::other)?;
        let hash = self.interfaces.hash(&topic.type_name);
        let metadata = BTreeMap::from([
            (
                "offered_qos_profiles".to_owned(),
                offered_quality(topic.quality),
            ),
            (
                "topic_type_hash".to_owned(),
                hash.map_err(io::Error::other)?,
            ),
        ]);
        let writer = &mut self.writer;
        let channel = writer
            .add_schema(&topic.type_name, DEFINITION_ENCODING, definition.as_bytes())
            .and_then(|schema| writer.add_channel(schema, &topic.name, SAMPLE_ENCODING, &metadata))
            .map_err(io::Error::other)?;
        self.channels.insert(topic.name.clone(), channel);
        Ok(channel)
    }

    /// Makes all samples so far readable even if the process ends now.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush().map_err(io::Error::other)
    }

    /// Writes the index, and what is missing; `lost` samples arrived and could not be written in time.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(&mut self, lost: u64) -> io::Result<Written> {
        let channels = self.channels.iter();
        let missing = channels.map(|(topic, &channel)| (topic, self.received.missing(channel)));
        let missing = missing.filter(|&(_, count)| count > 0);
        let missing: BTreeMap<String, u64> = missing
            .map(|(topic, count)| (topic.clone(), count))
            .collect();
        let counts = missing
            .iter()
            .map(|(topic, count)| (format!("missing.{topic}"), count.to_string()));
        let metadata = Metadata {
            name: LOSSES.to_owned(),
            metadata: counts
                .chain([(LOST.to_owned(), lost.to_string())])
                .collect(),
        };
        self.writer
            .write_metadata(&metadata)
            .and_then(|()| self.writer.finish())
            .map_err(io::Error::other)?;
        Ok(Written {
            samples: self.written,
            lost,
            missing,
        })
    }
}

/// The quality of service of publishers, as `ros2 bag` of every distribution reads it: policies as numbers of `rmw`.
fn offered_quality(quality: Quality) -> String {
    let (reliability, durability, depth) = match quality {
        Quality::TransientLocal { depth } => (1, 1, depth),
        Quality::ReliableVolatile { depth } => (1, 2, depth),
        Quality::BestEffort => (2, 2, 1),
    };
    let infinite = "\n    sec: 9223372036\n    nsec: 854775807";
    format!(
        "- history: 1\n  depth: {depth}\n  reliability: {reliability}\n  durability: {durability}\n  deadline:{infinite}\n  \
         lifespan:{infinite}\n  liveliness: 1\n  liveliness_lease_duration:{infinite}\n  \
         avoid_ros_namespace_conventions: false"
    )
}

#[cfg(test)]
pub(crate) mod tests {
    use std::fs;

    use super::*;
    use crate::read::read;

    /// A topic of a standard type.
    pub(crate) fn topic() -> RecordedTopic {
        RecordedTopic {
            name: "/formation/time".to_owned(),
            type_name: "builtin_interfaces/msg/Time".to_owned(),
            quality: Quality::TransientLocal { depth: 1 },
        }
    }

    /// A sample of it.
    pub(crate) fn sample(sequence: u64) -> RawSample {
        let mut bytes = vec![0, 1, 0, 0];
        bytes.extend(u32::try_from(sequence).unwrap().to_le_bytes());
        bytes.extend([0; 4]);
        RawSample {
            publisher: 7,
            sequence,
            sent_ns: Some(1_000 + sequence),
            received_ns: 2_000 + sequence,
            bytes,
        }
    }

    pub(crate) fn interfaces() -> Interfaces {
        Interfaces::with(&[]).unwrap()
    }

    #[test]
    fn samples_are_read_as_they_were_written_and_each_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.mcap");
        let mut file = RecordingFile::create(&path, interfaces()).unwrap();
        for sequence in [1, 2, 5, 2] {
            file.write(&topic(), &sample(sequence)).unwrap();
        }
        let written = file.finish(3).unwrap();
        assert_eq!(
            written.to_string(),
            "recorded 3 samples; 3 arrived faster than they could be written, and were lost; 2 of /formation/time did not \
             arrive"
        );
        let mut found = Vec::new();
        let summary = read(&path, |recorded| {
            assert_eq!(recorded.topic, "/formation/time");
            assert_eq!(recorded.type_name, "builtin_interfaces/msg/Time");
            found.push((recorded.received_ns, recorded.bytes.to_vec()));
        })
        .unwrap();
        let expected = [1, 2, 5].map(|sequence| {
            let sample = sample(sequence);
            (sample.received_ns, sample.bytes)
        });
        assert_eq!(found, expected);
        assert_eq!((summary.damage, summary.lost), (None, Some(3)));
    }

    #[test]
    fn the_publisher_that_is_silent_for_longest_makes_room_and_its_gaps_count() {
        let mut received = Received::default();
        let mut insert = |publisher, sequence, received_ns| {
            let sample = RawSample {
                publisher,
                received_ns,
                ..sample(sequence)
            };
            received.insert(1, &sample)
        };
        assert!(insert(0, 1, 10) && insert(0, 4, 10), "two are missing");
        for publisher in 1..PUBLISHERS_MAX as u128 {
            assert!(insert(publisher, 1, 20));
        }
        assert!(!insert(0, 4, 15), "it is known");
        assert!(insert(u128::MAX, 1, 30));
        assert!(insert(0, 4, 40), "it made room, and takes that of another");
        assert_eq!(received.publishers.len(), PUBLISHERS_MAX);
        assert_eq!((received.missing(1), received.missing(2)), (2, 0));
    }

    #[test]
    fn without_its_end_a_file_is_read_up_to_the_last_flush() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.mcap");
        let mut file = RecordingFile::create(&path, interfaces()).unwrap();
        file.write(&topic(), &sample(1)).unwrap();
        file.flush().unwrap();
        file.write(&topic(), &sample(2)).unwrap();
        let crashed = fs::read(&path).unwrap();
        drop(file);
        fs::write(&path, crashed).unwrap();
        let mut found = 0;
        let summary = read(&path, |_| found += 1).unwrap();
        assert_eq!(found, 1);
        assert!(summary.damage.is_some());
    }
}
