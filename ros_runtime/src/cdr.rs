//! CDR, the encoding of samples: four bytes that name the byte order, then the data.

use byteorder::{BigEndian, LittleEndian};
#[cfg(any(test, feature = "zenoh"))]
use serde::Serialize;
use serde::de::DeserializeOwned;

#[cfg(any(test, feature = "zenoh"))]
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// The data in the byte order that `rmw_zenoh_cpp` writes.
#[cfg(any(test, feature = "zenoh"))]
pub(crate) fn encoded<M: Serialize>(data: &M) -> Result<Vec<u8>, String> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    let body = cdr_encoding::to_vec::<M, LittleEndian>(data).map_err(|error| error.to_string())?;
    bytes.extend(body);
    Ok(bytes)
}

/// The data in these bytes, in either byte order.
///
/// # Errors
/// Says why they do not decode.
pub fn decoded<M: DeserializeOwned>(bytes: &[u8]) -> Result<M, String> {
    let (head, body) = bytes
        .split_first_chunk::<4>()
        .ok_or("it is too short to name its byte order")?;
    // The last two bytes are options, such as the number of padding bytes.
    let decoded = match head[..2] {
        [0, 0] => cdr_encoding::from_bytes::<M, BigEndian>(body),
        [0, 1] => cdr_encoding::from_bytes::<M, LittleEndian>(body),
        _ => return Err(format!("its encoding {head:?} is unknown")),
    };
    decoded
        .map(|(data, _)| data)
        .map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_byte_order_is_read() {
        let data = (7_u32, "abc".to_owned());
        let bytes = encoded(&data).unwrap();
        assert_eq!(
            bytes,
            [0, 1, 0, 0, 7, 0, 0, 0, 4, 0, 0, 0, b'a', b'b', b'c', 0]
        );
        assert_eq!(decoded(&bytes), Ok(data.clone()));
        let big = [0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 4, b'a', b'b', b'c', 0];
        assert_eq!(decoded(&big), Ok(data));
        for length in 0..bytes.len() {
            assert!(decoded::<(u32, String)>(&bytes[..length]).is_err());
        }
        assert!(decoded::<u32>(&[0, 9, 0, 0, 7, 0, 0, 0]).is_err());
    }
}
