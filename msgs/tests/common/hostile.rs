//! Well-formed CDR of any type, made from its description alone, with values that no sound sender would send.

use formation_generate::Random;
use serde_reflection::{ContainerFormat, Format, Registry};

/// Numbers at which something is likely to break, and small ones, which are likely to name something.
const NUMBERS: [u64; 12] = [
    0,
    1,
    7,
    255,
    10_000,
    i32::MAX.unsigned_abs() as u64,
    u32::MAX as u64 - 1,
    u32::MAX as u64,
    1 << 60,
    i64::MAX.unsigned_abs(),
    i64::MIN.unsigned_abs(),
    u64::MAX,
];
const FLOATS: [f64; 10] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN_POSITIVE,
    -0.0,
    1.0e6,
    1.000_000_1e6,
    -1.0e300,
    1.0e-300,
];

/// Writes one value after the other, little-endian, aligned as CDR has it.
pub struct Writer<'a> {
    registry: &'a Registry,
    random: Random,
    body: Vec<u8>,
    /// Whether some list claims to be longer than it is.
    pub lied: bool,
    may_lie: bool,
}

impl<'a> Writer<'a> {
    /// The payload of a value of the named type; with `may_lie`, one in forty lists has a wrong length.
    pub fn payload(
        registry: &'a Registry,
        name: &str,
        seed: u64,
        may_lie: bool,
    ) -> (Vec<u8>, bool) {
        let mut writer = Self {
            registry,
            random: Random::from_seed(seed),
            body: Vec::new(),
            lied: false,
            may_lie,
        };
        writer.container(name);
        ([&[0, 1, 0, 0][..], &writer.body].concat(), writer.lied)
    }

    fn one_in(&mut self, count: u64) -> bool {
        self.random.below(count) == 0
    }

    fn put(&mut self, bytes: &[u8]) {
        let size = bytes.len();
        self.body.resize(self.body.len().next_multiple_of(size), 0);
        self.body.extend_from_slice(bytes);
    }

    fn number(&mut self) -> u64 {
        match self.random.below(8) {
            0 => NUMBERS[self.random.index(NUMBERS.len())],
            _ => self.random.below(8),
        }
    }

    fn float(&mut self) -> f64 {
        match self.random.below(12) {
            0 => FLOATS[self.random.index(FLOATS.len())],
            _ => f64::from(u32::try_from(self.random.below(20)).unwrap()) / 4.0,
        }
    }

    fn length(&mut self) -> u32 {
        u32::try_from(self.random.below(4)).unwrap()
    }

    /// What is written for a length: the truth, or a number at which memory would burst.
    fn put_length(&mut self, length: u32) {
        let lies = self.may_lie && self.one_in(40);
        self.lied |= lies;
        let written = if lies {
            [u32::MAX, i32::MAX.unsigned_abs(), 10_001, length + 1][self.random.index(4)]
        } else {
            length
        };
        self.put(&written.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.put_length(u32::try_from(text.len()).unwrap() + 1);
        for byte in text.bytes().chain([0]) {
            self.put(&[byte]);
        }
    }

    fn container(&mut self, name: &str) {
        match self.registry.get(name).unwrap() {
            ContainerFormat::UnitStruct => {}
            ContainerFormat::NewTypeStruct(format) => self.value(format),
            ContainerFormat::TupleStruct(formats) => {
                formats.iter().for_each(|format| self.value(format));
            }
            ContainerFormat::Struct(fields) => {
                for field in fields {
                    // Another version or size ends the examination of a message before it has begun.
                    match field.name.as_str() {
                        "protocol_version" if !self.one_in(8) => {
                            self.put(&formation_msgs::PROTOCOL_VERSION.to_le_bytes());
                        }
                        "module_size" if !self.one_in(8) => self.put(&1.0_f64.to_le_bytes()),
                        "body_width" if !self.one_in(8) => self.put(&0.0_f64.to_le_bytes()),
                        "body" if !self.one_in(8) => self.put(&[1]),
                        "policy" if !self.one_in(8) => {
                            let policies = ["exact", "paper", "auction", "nearest"];
                            let policy = policies[self.random.index(policies.len())];
                            self.text(policy);
                        }
                        // A policy but `paper` has none, and one but `given` no allocation.
                        "policy_options" | "allocation" | "detached" if !self.one_in(8) => {
                            self.put_length(0);
                        }
                        "key" if !self.one_in(8) => self.text("max"),
                        "value" if !self.one_in(8) => self.text("40"),
                        _ => self.value(&field.value),
                    }
                }
            }
            ContainerFormat::Enum(_) => panic!("ROS 2 messages have no enumerations"),
        }
    }

    fn value(&mut self, format: &Format) {
        match format {
            Format::TypeName(name) => self.container(name),
            Format::Bool => {
                let bit = u8::from(self.one_in(3));
                self.put(&[bit]);
            }
            Format::U8 => {
                let number = self.number().to_le_bytes()[0];
                self.put(&[number]);
            }
            Format::I32 | Format::U32 => {
                let number = self.number().to_le_bytes();
                self.put(&number[..4]);
            }
            Format::I64 | Format::U64 => {
                let number = self.number().to_le_bytes();
                self.put(&number);
            }
            Format::F64 => {
                let number = self.float().to_le_bytes();
                self.put(&number);
            }
            Format::Str => {
                let length = self.length();
                self.put_length(length + 1);
                for _ in 0..length {
                    let character = b'a' + u8::try_from(self.random.below(26)).unwrap();
                    self.put(&[character]);
                }
                self.put(&[0]);
            }
            Format::Seq(entry) => {
                let length = self.length();
                self.put_length(length);
                (0..length).for_each(|_| self.value(entry));
            }
            other => panic!("no field of the package has the format {other:?}"),
        }
    }
}
