//! The names, numbers and attachments by which `rmw_zenoh_cpp` maps ROS 2 onto Zenoh.
//!
//! See the design document of [rmw_zenoh](https://github.com/ros2/rmw_zenoh/blob/rolling/docs/design.md).

use xxhash_rust::xxh3::xxh3_128;

use crate::topic::Quality;

/// The first part of the key of every liveliness token.
const ADMIN_SPACE: &str = "@ros2_lv";

/// The depth that a token leaves out.
const DEPTH_DEFAULT: usize = 42;

/// Identifies the endpoint that sent a sample or request.
pub(super) type Gid = [u8; 16];

/// What a token announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Publisher,
    Subscription,
    Server,
}

impl Kind {
    fn code(self) -> &'static str {
        match self {
            Self::Publisher => "MP",
            Self::Subscription => "MS",
            Self::Server => "SS",
        }
    }
}

/// The node of a process, as its tokens name it.
#[derive(Clone, Debug)]
pub(super) struct NodeKeys {
    pub domain: u16,
    /// The identifier of the Zenoh session, in hexadecimal digits.
    pub session: String,
    pub namespace: String,
    pub name: String,
}

/// A topic or a service.
#[derive(Clone, Debug)]
pub(super) struct Place<'a> {
    /// Its fully qualified name.
    pub name: &'a str,
    /// Its type, such as `std_msgs/msg/Header`.
    pub type_name: &'a str,
    /// The hash of the type.
    pub hash: &'a str,
}

/// A name as one part of a key.
pub(super) fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

/// The name that the type has on DDS, which keys use as well.
fn dds_type(name: &str) -> String {
    match name.rsplit_once('/') {
        Some((folder, name)) => format!("{}::dds_::{name}_", folder.replace('/', "::")),
        None => name.to_owned(),
    }
}

impl Place<'_> {
    /// The key of its samples or requests.
    pub(super) fn key(&self, domain: u16) -> String {
        let name = self.name.trim_matches('/');
        format!("{domain}/{name}/{}/{}", dds_type(self.type_name), self.hash)
    }
}

impl NodeKeys {
    /// The node has number 0 in its session.
    fn prefix(&self, number: u64, kind: &str) -> String {
        format!(
            "{ADMIN_SPACE}/{}/{}/0/{number}/{kind}/%/{}/{}",
            self.domain,
            self.session,
            mangled(&self.namespace),
            mangled(&self.name)
        )
    }

    /// The fully qualified name of the node.
    pub(super) fn node(&self) -> String {
        let namespace = self.namespace.trim_end_matches('/');
        format!("{namespace}/{}", self.name)
    }

    /// The token of the node.
    pub(super) fn token(&self) -> String {
        self.prefix(0, "NN")
    }

    /// The token of an endpoint with this number in its session.
    pub(super) fn endpoint_token(
        &self,
        number: u64,
        kind: Kind,
        place: &Place<'_>,
        quality: Quality,
    ) -> String {
        format!(
            "{}/{}/{}/{}/{}",
            self.prefix(number, kind.code()),
            mangled(place.name),
            dds_type(place.type_name),
            place.hash,
            quality_code(quality)
        )
    }
}

/// The quality of service: reliability, durability, history and depth, deadline, lifespan, and liveliness with its lease.
/// What is as the defaults have it is left out.
fn quality_code(quality: Quality) -> String {
    let (reliability, durability, depth) = match quality {
        Quality::TransientLocal { depth } => ("", "1", depth),
        Quality::ReliableVolatile { depth } => ("", "", depth),
        Quality::BestEffort => ("2", "", 1),
    };
    let depth = match depth {
        DEPTH_DEFAULT => String::new(),
        depth => depth.to_string(),
    };
    format!("{reliability}:{durability}:,{depth}:,:,:,,")
}

/// The identifier of the endpoint with this token.
pub(super) fn gid_of(token: &str) -> Gid {
    xxh3_128(token.as_bytes()).to_le_bytes()
}

/// What accompanies each sample, request and reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attachment {
    /// Counts the samples or requests of an endpoint, from 1.
    pub sequence: i64,
    /// When it was sent, in nanoseconds since 1970.
    pub stamp_ns: i64,
    /// The publisher or client.
    pub source: Gid,
}

/// The length of an attachment: two numbers, the length of the identifier, and the identifier.
const ATTACHMENT_BYTES: usize = 33;

impl Attachment {
    /// As Zenoh's serialiser writes it.
    pub(super) fn to_bytes(self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(ATTACHMENT_BYTES);
        bytes.extend(self.sequence.to_le_bytes());
        bytes.extend(self.stamp_ns.to_le_bytes());
        bytes.push(16);
        bytes.extend(self.source);
        bytes
    }

    /// The attachment in these bytes, if they are one.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk::<8>()?;
        let (stamp, rest) = rest.split_first_chunk::<8>()?;
        let (length, source) = rest.split_first()?;
        Some(Self {
            sequence: i64::from_le_bytes(*sequence),
            stamp_ns: i64::from_le_bytes(*stamp),
            source: source.try_into().ok().filter(|_| *length == 16)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn node(namespace: &str) -> NodeKeys {
        NodeKeys {
            domain: 2,
            session: "aac3178e146ba6f1fc6e6a4085e77f21".to_owned(),
            namespace: namespace.to_owned(),
            name: "listener".to_owned(),
        }
    }

    const CHATTER: Place<'_> = Place {
        name: "/robot1/chatter",
        type_name: "std_msgs/msg/String",
        hash: HASH,
    };

    /// The examples of rmw_zenoh's design document, and what its source gives for others.
    #[test]
    fn keys_are_those_of_rmw_zenoh() {
        assert_eq!(
            CHATTER.key(2),
            format!("2/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}")
        );
        assert_eq!(
            node("/").token(),
            "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
        );
        let quality = Quality::ReliableVolatile { depth: 10 };
        assert_eq!(
            node("/a/b").endpoint_token(11, Kind::Subscription, &CHATTER, quality),
            format!(
                "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/11/MS/%/%a%b/listener/%robot1%chatter/\
                 std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
            )
        );
        let goal = dds_type("formation_msgs/action/FormConfiguration_SendGoal");
        assert_eq!(
            goal,
            "formation_msgs::action::dds_::FormConfiguration_SendGoal_"
        );
    }

    #[test]
    fn only_what_differs_from_the_defaults_is_written() {
        for (quality, code) in [
            (Quality::ReliableVolatile { depth: 42 }, "::,:,:,:,,"),
            (Quality::ReliableVolatile { depth: 7 }, "::,7:,:,:,,"),
            (Quality::TransientLocal { depth: 1 }, ":1:,1:,:,:,,"),
            (Quality::BestEffort, "2::,1:,:,:,,"),
        ] {
            assert_eq!(quality_code(quality), code);
        }
    }

    #[test]
    fn attachments_are_33_bytes_and_others_are_refused() {
        let attachment = Attachment {
            sequence: 7,
            stamp_ns: 0x0102_0304_0506_0708,
            source: gid_of("a token"),
        };
        let bytes = attachment.to_bytes();
        assert_eq!(bytes.len(), ATTACHMENT_BYTES);
        assert_eq!(
            bytes[..17],
            [7, 0, 0, 0, 0, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 16]
        );
        assert_eq!(Attachment::from_bytes(&bytes), Some(attachment));
        for length in 0..ATTACHMENT_BYTES {
            assert_eq!(Attachment::from_bytes(&bytes[..length]), None);
        }
        assert_ne!(gid_of("a token"), gid_of("another token"));
    }
}
