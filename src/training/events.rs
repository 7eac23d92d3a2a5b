//! Event files that `TensorBoard` plots.
//!
//! A file is a row of records: length (u64, little endian), its masked CRC-32C, the bytes, their masked CRC-32C. The bytes
//! are a protocol buffer `Event { 1: wall_time double, 2: step int64, 3: file_version string, 5: summary { 1: value {
//! 1: tag string, 2: simple_value float } } }`.
//! Reference: tensorflow, `core/lib/io/record_writer.h` and `core/util/event.proto`.

use std::time::{SystemTime, UNIX_EPOCH};

/// The record that begins a file.
#[must_use]
pub(super) fn header() -> Vec<u8> {
    let mut event = wall_time();
    bytes_field(&mut event, 3, b"brain.Event:2");
    record(&event)
}

/// A record with some numbers at a step.
#[must_use]
pub(super) fn scalars(step: usize, values: &[(String, f64)]) -> Vec<u8> {
    let mut summary = Vec::new();
    for (tag, value) in values {
        let mut entry = Vec::new();
        bytes_field(&mut entry, 1, tag.as_bytes());
        entry.push(2 << 3 | 5);
        entry.extend_from_slice(&(*value as f32).to_le_bytes());
        bytes_field(&mut summary, 1, &entry);
    }
    let mut event = wall_time();
    event.push(2 << 3);
    varint(&mut event, step as u64);
    bytes_field(&mut event, 5, &summary);
    record(&event)
}

fn wall_time() -> Vec<u8> {
    let secs = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
    let mut event = vec![1 << 3 | 1];
    event.extend_from_slice(&secs.to_le_bytes());
    event
}

fn bytes_field(message: &mut Vec<u8>, number: u8, bytes: &[u8]) {
    message.push(number << 3 | 2);
    varint(message, bytes.len() as u64);
    message.extend_from_slice(bytes);
}

fn varint(message: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

fn record(bytes: &[u8]) -> Vec<u8> {
    let length = (bytes.len() as u64).to_le_bytes();
    [&length, &masked(&length).to_le_bytes()[..], bytes, &masked(bytes).to_le_bytes()].concat()
}

fn masked(bytes: &[u8]) -> u32 {
    crc32c(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

/// CRC-32C (Castagnoli), bit by bit: a record has some hundred bytes.
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc: u32, &byte| {
        (0..8).fold(
            crc ^ u32::from(byte),
            |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_the_standard() {
        // RFC 3720, B.4, and the usual check value.
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn a_record_holds_its_step_and_value() {
        let bytes = scalars(300, &[("loss/total".to_owned(), 1.5)]);
        let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        assert_eq!(bytes.len(), 8 + 4 + length + 4);
        let event = &bytes[12..12 + length];
        // Step 300 is the varint AC 02, after the nine bytes of the time.
        assert_eq!(event[9..12], [0x10, 0xac, 0x02]);
        let value = [[0x0a, 10].as_slice(), b"loss/total", &[0x15, 0, 0, 0xc0, 0x3f]].concat();
        assert_eq!(event[12..16], [0x2a, 2 + value.len() as u8, 0x0a, value.len() as u8]);
        assert_eq!(event[16..], value);
    }
}
