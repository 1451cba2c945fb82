//! Samples as they are on the wire, for programs that store them.

use std::convert::Infallible;

use rustdds::RepresentationIdentifier;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter};

/// A sample as it is on the wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawSample {
    /// The publisher, by the identifier of its endpoint.
    pub publisher: u128,
    /// Counts the samples of the publisher.
    pub sequence: u64,
    /// When it was sent, by the clock of the publisher, in nanoseconds since 1970; `None` if the publisher does not say.
    pub sent_ns: Option<u64>,
    /// When it arrived, in nanoseconds since 1970.
    pub received_ns: u64,
    /// CDR, with the four bytes in front that name its byte order.
    pub bytes: Vec<u8>,
}

/// Takes payloads from the DDS library without decoding them.
pub(crate) struct Undecoded;

/// The decoder of [`Undecoded`].
#[derive(Clone)]
pub(crate) struct Copying;

const ENCODINGS: [RepresentationIdentifier; 2] = [
    RepresentationIdentifier::CDR_LE,
    RepresentationIdentifier::CDR_BE,
];

impl DeserializerAdapter<Vec<u8>> for Undecoded {
    type Error = Infallible;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &ENCODINGS
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for Undecoded {
    type Decoder = Copying;
    const DECODER: Copying = Copying;
}

impl<'de> Decode<'de, Vec<u8>> for Copying {
    type Error = Infallible;

    fn decode_bytes(
        self,
        payload: &'de [u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Vec<u8>, Infallible> {
        // The library strips the header, whose last two bytes are options without a meaning for CDR.
        let mut bytes = encoding.to_bytes().to_vec();
        bytes.extend([0, 0]);
        bytes.extend(payload);
        Ok(bytes)
    }
}
