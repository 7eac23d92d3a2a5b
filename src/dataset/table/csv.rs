//! Number tables as text: one frame a line, with or without a line of names.

use csv::{ByteRecord, ReaderBuilder};

use super::{TableError, channel_name};
use crate::motion::{Frame, MotionError, NUM_CHANNELS, bounds, joint_index};

/// Frames of a table separated by commas, semicolons, tabs or spaces, whichever the first line shows.
pub(super) fn parse_csv(bytes: &[u8]) -> Result<Vec<Frame>, TableError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let first_line = bytes.split(|&byte| byte == b'\n').find(|line| !line.trim_ascii().is_empty());
    let first_line = first_line.unwrap_or_default().trim_ascii();
    let delimiter = *b",;\t ".iter().find(|delimiter| first_line.contains(delimiter)).unwrap_or(&b',');

    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .delimiter(delimiter)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let mut frames = Vec::new();
    let mut record = ByteRecord::new();
    let mut first = true;
    while reader
        .read_byte_record(&mut record)
        .map_err(|error| TableError::Csv { reason: crate::dataset::one_line(&error.to_string()) })?
    {
        let line = record.position().map_or(0, csv::Position::line);
        let is_header = std::mem::take(&mut first) && record.iter().any(|field| number(field).is_none());
        if record.len() != NUM_CHANNELS {
            return Err(TableError::Columns { line, found: record.len() });
        }
        if is_header {
            check_header(&record)?;
            continue;
        }
        if frames.len() == bounds::MAX_FRAMES {
            return Err(MotionError::TooLong { found: frames.len() + 1 }.into());
        }
        let mut channels = [0.0; NUM_CHANNELS];
        for (column, (channel, field)) in channels.iter_mut().zip(&record).enumerate() {
            *channel = number(field).ok_or_else(|| TableError::NotANumber {
                line,
                column: column + 1,
                found: crate::dataset::one_line(&String::from_utf8_lossy(field)),
            })?;
        }
        frames.push(Frame::from_channels(&channels));
    }
    Ok(frames)
}

fn number(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// A header may say anything but contradict the order: a joint's name must stand at that joint's place.
fn check_header(header: &ByteRecord) -> Result<(), TableError> {
    for (column, field) in header.iter().enumerate() {
        let name = String::from_utf8_lossy(field);
        if joint_index(&name).is_some_and(|joint| joint != column) {
            return Err(TableError::Header {
                column: column + 1,
                found: crate::dataset::one_line(&name),
                expected: channel_name(column),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::JOINTS;

    fn row(separator: &str) -> String {
        (0..NUM_CHANNELS).map(|i| format!("{}", i as f64 * 0.01)).collect::<Vec<_>>().join(separator)
    }

    #[test]
    fn separators_headers_and_line_ends_are_understood() {
        let names: Vec<&str> = JOINTS.iter().map(|j| j.name).chain(["x", "y", "z", "r", "p", "w"]).collect();
        for text in [
            format!("{}\n{}\n", row(","), row(",")),
            format!("{}\r\n{}", row(";"), row(" ; ")),
            format!("\u{feff}{}\n{}\n\n{}", names.join(","), row(","), row(", ")),
            format!("{}\n{}\n", row("\t"), row("\t")),
            format!("{}\n{}\n", row(" "), row(" ")),
        ] {
            let frames = parse_csv(text.as_bytes()).unwrap_or_else(|error| panic!("{error}: {text}"));
            assert_eq!(frames.len(), 2);
            assert_eq!(frames[1].root_rotation_rad[2], 0.49);
        }
    }

    #[test]
    fn faults_are_named_with_line_and_column() {
        let mut wrong = row(",");
        wrong.push_str(",1");
        let bad = row(",").replace("0.03,", "abc,");
        let swapped: String = format!("BLNx_joint,BLNz_joint{}\n{}", ",a".repeat(NUM_CHANNELS - 2), row(","));
        for (text, reason) in [
            (wrong, "line 1: found 51 columns, expected 50"),
            (format!("{}\n{}", row(","), "1,2"), "line 2: found 2 columns, expected 50"),
            (format!("{}\n{bad}", row(",")), "line 2, column 4: \"abc\" is not a number"),
            (swapped, "column 2 is headed \"BLNz_joint\", expected BLNy_joint"),
        ] {
            let message = parse_csv(text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains(reason), "{message} should contain {reason}");
        }
        assert!(parse_csv(b"").unwrap().is_empty());
    }
}
