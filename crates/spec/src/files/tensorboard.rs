//! Scalars as TensorBoard's event files: TFRecords of Event messages.
//!
//! A record is the length of its data (u64), the masked CRC-32C of that length, the data, and theirs; an Event
//! has wall_time (1), step (2) and one of file_version (3), a summary (5) of values with tag (1) and simple_value
//! (2), and session_log (7) (tensorflow/core/lib/io/record_writer.h, tensorflow/core/util/event.proto).

/// How the name of an event file begins.
pub const NAME: &str = "events.out.tfevents";

/// A number at a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Scalar {
    pub tag: &'static str,
    pub step: usize,
    /// Seconds since 1970, or since the training began.
    pub time_s: f64,
    pub value: f64,
}

/// The bytes of an event file.
pub fn events(scalars: &[Scalar]) -> Vec<u8> {
    [header(), records(scalars)].concat()
}

/// The beginning of an event file.
pub fn header() -> Vec<u8> {
    record(&[double(1, 0.0), bytes(3, b"brain.Event:2")].concat())
}

/// A record that makes earlier ones of this step and later steps void: training began again before them.
pub fn restart(time_s: f64, step: usize) -> Vec<u8> {
    // session_log (7) with status (1) START.
    record(&[at(time_s, step), bytes(7, &[1 << 3, 1])].concat())
}

/// The records of scalars, to be appended to a file.
pub fn records(scalars: &[Scalar]) -> Vec<u8> {
    let of = |scalar: &Scalar| {
        let value = (scalar.value as f32).to_le_bytes();
        let value = [&bytes(1, scalar.tag.as_bytes())[..], &[2 << 3 | 5], &value].concat();
        record(&[at(scalar.time_s, scalar.step), bytes(5, &bytes(1, &value))].concat())
    };
    scalars.iter().flat_map(of).collect()
}

/// The time and the step of an event.
fn at(time_s: f64, step: usize) -> Vec<u8> {
    [&double(1, time_s)[..], &[2 << 3], &varint(step as u64)].concat()
}

fn record(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    let [of_length, of_data] = [&length, data].map(|of| masked_crc(of).to_le_bytes());
    [&length[..], &of_length, data, &of_data].concat()
}

/// A field of eight bytes.
fn double(field: u8, value: f64) -> Vec<u8> {
    [&[field << 3 | 1][..], &value.to_le_bytes()].concat()
}

/// A field of bytes with their length.
fn bytes(field: u8, value: &[u8]) -> Vec<u8> {
    [&[field << 3 | 2][..], &varint(value.len() as u64), value].concat()
}

/// Seven bits a byte, the lowest first.
fn varint(mut value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
    out
}

/// CRC-32C (Castagnoli), rotated and shifted as TFRecords want it.
fn masked_crc(data: &[u8]) -> u32 {
    let crc = !data.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            crc >> 1 ^ (0x82f6_3b78 & 0u32.wrapping_sub(crc & 1))
        })
    });
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_and_numbers_are_those_of_the_formats() {
        // The check value of CRC-32C, of the digits 1 to 9, is e3069283.
        let unmasked = masked_crc(b"123456789").wrapping_sub(0xa282_ead8).rotate_left(15);
        assert_eq!(unmasked, 0xe306_9283);
        assert_eq!(varint(300), [0xac, 0x02]);
        assert_eq!(varint(0), [0]);
    }

    #[test]
    fn an_event_holds_its_tag_and_value() {
        let scalar = Scalar { tag: "a", step: 3, time_s: 1.5, value: 2.0 };
        let file = events(&[scalar]);
        let first = 8 + 4 + u64::from_le_bytes(file[..8].try_into().unwrap()) as usize + 4;
        let data = &file[first + 12..file.len() - 4];
        let expected = [
            &[0x09][..],
            &1.5f64.to_le_bytes(),
            &[0x10, 3, 0x2a, 10, 0x0a, 8, 0x0a, 1, b'a', 0x15],
            &2.0f32.to_le_bytes(),
        ];
        assert_eq!(data, expected.concat());
    }
}
