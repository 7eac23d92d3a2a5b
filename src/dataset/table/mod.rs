//! Motions as number tables, `frames x 50`: 44 joint angles in KIT order, root position, root roll, pitch and yaw.
//!
//! In: the bytes of a `.npy`, `.npz` or `.csv`. Out: frames in metres and radians.
//! Tables are what models generate, so this is where degrees, millimetres and foreign skeletons turn up.

mod csv;
mod npy;

use super::archive;
use super::entry::Format;
use super::files::{FileError, MAX_MOTION_BYTES};
use crate::mocap::{MAX_FRAMES, PositionOrder};
use crate::motion::{Frame, JOINTS, MotionError, NUM_CHANNELS, NUM_JOINTS, ROOT_CHANNEL_NAMES, bounds};
use std::f64::consts::TAU;

/// Most arrays looked at in an `.npz`.
const MAX_ARRAYS: usize = 64;

/// Root height beyond which positions are taken for millimetres, metres.
const ABSURD_HEIGHT_M: f64 = 10.0;

/// What a table says.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) content: Content,
    /// Rate and body height, which only an `.npz` can state.
    pub(super) rate_hz: Option<f64>,
    pub(super) height_m: Option<f64>,
    pub(super) warnings: Vec<String>,
}

/// What the numbers of a table are.
#[derive(Debug)]
pub(super) enum Content {
    /// Frames of the humanoid.
    Frames(Vec<Frame>),
    /// Joint centres, frame after frame, in a known order.
    Positions(PositionOrder, Vec<[f64; 3]>),
}

/// Why a table is not a motion.
#[derive(Debug, thiserror::Error)]
pub(super) enum TableError {
    #[error("not an .npy array: {reason}")]
    NotNpy { reason: String },
    #[error(
        "the array holds {found:?}, expected numbers such as \"<f4\" or \"<f8\" (objects, which need pickle, are never read)"
    )]
    Dtype { found: String },
    #[error("the array should be {shape}, but the file holds only {found} bytes of data: it is truncated")]
    Truncated { shape: String, found: usize },
    #[error(
        "expected frames x {NUM_CHANNELS} (or joint positions, frames x 21 x 3 or frames x 22 x 3), found {found}"
    )]
    Shape { found: String },
    #[error("the .npz {0}")]
    Npz(#[from] FileError),
    #[error("{array}.npy in the .npz: {source}")]
    Array { array: String, source: Box<TableError> },
    #[error(
        "the .npz holds {found}, expected an array named motion or a single array of frames x {NUM_CHANNELS}"
    )]
    NoMotion { found: String },
    #[error("not a table: {reason}")]
    Csv { reason: String },
    #[error("line {line}: found {found} columns, expected {NUM_CHANNELS}")]
    Columns { line: u64, found: usize },
    #[error("line {line}, column {column}: {found:?} is not a number")]
    NotANumber { line: u64, column: usize, found: String },
    #[error("column {column} is headed {found:?}, expected {expected}: columns must be in KIT order")]
    Header { column: usize, found: String, expected: &'static str },
    #[error(
        "frame {frame}: {channel} is {found} rad, more than a full turn: are the angles in degrees? radians are expected"
    )]
    Degrees { frame: usize, channel: &'static str, found: f64 },
    #[error(
        "frame {frame}: the root is at a height of {found} m: are the positions in millimetres? metres are expected"
    )]
    Millimetres { frame: usize, found: f64 },
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// Reads a table and checks its units.
pub(super) fn read_table(bytes: &[u8], format: Format) -> Result<Table, TableError> {
    let mut table = match format {
        Format::Csv => Table::of(Content::Frames(csv::parse_csv(bytes)?)),
        Format::Npz => read_npz(bytes)?,
        Format::Npy | Format::Mmm | Format::Bvh | Format::Amc => {
            Table::of(content_of(&npy::parse_npy(bytes)?)?)
        }
    };
    check_units(&mut table)?;
    Ok(table)
}

impl Table {
    fn of(content: Content) -> Self {
        Self { content, rate_hz: None, height_m: None, warnings: Vec::new() }
    }
}

fn content_of(array: &npy::Array<'_>) -> Result<Content, TableError> {
    match *array.shape {
        [num_frames, NUM_CHANNELS] if num_frames > bounds::MAX_FRAMES => {
            Err(MotionError::TooLong { found: num_frames }.into())
        }
        [num_frames, NUM_CHANNELS] => Ok(Content::Frames(
            (0..num_frames)
                .map(|frame| Frame::from_channels(&std::array::from_fn(|channel| array.at(frame, channel))))
                .collect(),
        )),
        [num_frames, num_joints, 3] if num_frames <= MAX_FRAMES => {
            let shape_error = || TableError::Shape { found: shape_text(&array.shape) };
            let order = PositionOrder::of_count(num_joints).ok_or_else(shape_error)?;
            let places = (0..num_frames).flat_map(|frame| (0..num_joints).map(move |joint| (frame, joint)));
            let centres =
                places.map(|(frame, joint)| std::array::from_fn(|axis| array.at_3([frame, joint, axis])));
            Ok(Content::Positions(order, centres.collect()))
        }
        _ => Err(TableError::Shape { found: shape_text(&array.shape) }),
    }
}

/// `10 x 263`.
fn shape_text(shape: &[usize]) -> String {
    match shape {
        [] => "a single number".to_owned(),
        [length] => format!("a row of {length}"),
        _ => shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" x "),
    }
}

/// An `.npz`: the array `motion`, or the only one that is not a setting; `rate_hz` and `height_m` are settings.
fn read_npz(bytes: &[u8]) -> Result<Table, TableError> {
    let mut zip = archive::open_in_memory(bytes)?;
    let mut arrays: Vec<(String, usize)> = (0..zip.len().min(MAX_ARRAYS))
        .filter_map(|index| {
            let name = zip.by_index_data(index).ok()?.name().ok()?.into_owned();
            Some((name.strip_suffix(".npy")?.to_owned(), index))
        })
        .collect();
    arrays.sort();
    let mut read = |index| archive::read_entry(&mut zip, index, MAX_MOTION_BYTES);
    let within =
        |array: &str, error| TableError::Array { array: super::one_line(array), source: Box::new(error) };

    let mut setting = |name: &str| -> Result<Option<f64>, TableError> {
        let Some((_, index)) = arrays.iter().find(|(array, _)| array == name) else { return Ok(None) };
        let bytes = read(*index)?;
        let array = npy::parse_npy(&bytes).map_err(|error| within(name, error))?;
        let shape = || TableError::Shape { found: shape_text(&array.shape) };
        array.scalar().map(Some).ok_or_else(|| within(name, shape()))
    };
    let (rate_hz, height_m) = (setting("rate_hz")?, setting("height_m")?);

    arrays.retain(|(name, _)| name != "rate_hz" && name != "height_m");
    let named = arrays.iter().find(|(name, _)| name == "motion");
    let chosen = named.or(if let [only] = arrays.as_slice() { Some(only) } else { None });
    let Some((name, index)) = chosen else {
        let names: Vec<String> = arrays.iter().map(|(name, _)| super::one_line(name)).collect();
        let found = if names.is_empty() { "no array".to_owned() } else { names.join(", ") };
        return Err(TableError::NoMotion { found });
    };
    let bytes = read(*index)?;
    let content =
        npy::parse_npy(&bytes).and_then(|array| content_of(&array)).map_err(|error| within(name, error))?;
    Ok(Table { rate_hz, height_m, ..Table::of(content) })
}

/// Name of a channel in messages.
fn channel_name(channel: usize) -> &'static str {
    if channel < NUM_JOINTS { JOINTS[channel].name } else { ROOT_CHANNEL_NAMES[channel - NUM_JOINTS] }
}

/// Refuses tables that are in degrees or millimetres in most frames, warns of single absurd angles and of y up.
///
/// No human joint turns once around (the widest limit is 3.32 rad), and no root is 10 m above the floor.
fn check_units(table: &mut Table) -> Result<(), TableError> {
    let Table { content: Content::Frames(frames), warnings, .. } = table else { return Ok(()) };
    let majority = |count: usize| 2 * count > frames.len();

    let turned = |frame: &Frame| {
        let angles = frame.joint_angles_rad.iter().enumerate();
        angles.map(|(joint, angle)| (joint, *angle)).find(|(_, angle)| angle.is_finite() && angle.abs() > TAU)
    };
    let mut turns = frames.iter().enumerate().filter_map(|(index, frame)| Some((index, turned(frame)?)));
    if let Some((frame, (joint, found))) = turns.next() {
        let channel = channel_name(joint);
        let count = 1 + turns.count();
        if majority(count) {
            return Err(TableError::Degrees { frame, channel, found });
        }
        warnings.push(format!(
            "{count} frames have a joint angle of more than a full turn, first {channel} with {found} rad in frame {frame}"
        ));
    }

    let high = |frame: &Frame| {
        let height = frame.root_position_m[2];
        height.is_finite() && height.abs() > ABSURD_HEIGHT_M
    };
    let mut heights = frames.iter().enumerate().filter(|(_, frame)| high(frame));
    if let Some((frame, first)) = heights.next()
        && majority(1 + heights.count())
    {
        return Err(TableError::Millimetres { frame, found: first.root_position_m[2] });
    }

    // With y up the root is at hip height in y, and its own up axis is far from z.
    let y_up = |frame: &&Frame| {
        let [roll, pitch, _] = frame.root_rotation_rad;
        (0.4..1.6).contains(&frame.root_position_m[1]) && (roll.cos() * pitch.cos()).abs() < 0.5
    };
    if majority(frames.iter().filter(y_up).count()) {
        warnings.push(
            "the body lies on its side at hip height in most frames: is y up? z up is expected".to_owned(),
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::npy::tests::npy;
    use super::*;
    use std::io::Write as _;

    fn array(shape: &str, values: &[f64]) -> Vec<u8> {
        let data: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        npy(&format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n"), &data)
    }

    fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, bytes) in arrays {
            writer.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
            writer.write_all(bytes).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    fn frames(table: &Table) -> &[Frame] {
        match &table.content {
            Content::Frames(frames) => frames,
            Content::Positions(..) => panic!("positions"),
        }
    }

    fn constant(value: f64) -> Vec<u8> {
        array("(3, 50)", &[value; 150])
    }

    #[test]
    fn npz_takes_motion_or_the_only_array() {
        let rate = ("rate_hz.npy", array("()", &[20.0]));
        let height = ("height_m.npy", array("(1,)", &[1.6]));
        let table =
            read_table(&npz(&[("poses.npy", constant(0.5)), rate.clone(), height]), Format::Npz).unwrap();
        assert_eq!((frames(&table).len(), table.rate_hz, table.height_m), (3, Some(20.0), Some(1.6)));
        let both = npz(&[("a.npy", constant(0.1)), ("motion.npy", constant(0.5))]);
        assert_eq!(frames(&read_table(&both, Format::Npz).unwrap())[0].joint_angles_rad[0], 0.5);

        for (bytes, reason) in [
            (npz(&[("a.npy", constant(0.1)), ("b.npy", constant(0.1))]), "the .npz holds a, b, expected"),
            (npz(&[rate]), "the .npz holds no array"),
            (
                npz(&[("m.npy", array("(2, 24, 3)", &[0.0; 144]))]),
                "m.npy in the .npz: expected frames x 50 (or joint positions, frames x 21 x 3 or frames x 22 x 3), found 2 x 24 x 3",
            ),
            (npz(&[("m.npy", b"no".to_vec())]), "m.npy in the .npz: not an .npy array"),
            (npz(&[("m.npy", constant(0.0)), ("rate_hz.npy", array("(2,)", &[1.0, 2.0]))]), "rate_hz.npy"),
            (b"PK".to_vec(), "the .npz cannot be unpacked"),
        ] {
            let message = read_table(&bytes, Format::Npz).unwrap_err().to_string();
            assert!(message.contains(reason), "{message} should contain {reason}");
        }
    }

    #[test]
    fn shapes_are_named() {
        for (shape, values, reason) in [
            ("(10, 263)", 2630, "found 10 x 263"),
            ("(50,)", 50, "found a row of 50"),
            ("()", 1, "found a single number"),
        ] {
            let bytes = array(shape, &vec![0.0; values]);
            assert!(read_table(&bytes, Format::Npy).unwrap_err().to_string().contains(reason));
        }
    }

    #[test]
    fn degrees_millimetres_and_y_up_are_suspected() {
        let read = |change: &dyn Fn(usize, &mut Frame)| {
            let mut values = Vec::new();
            for index in 0..3 {
                let mut frame = Frame { root_position_m: [0.0, 0.0, 0.9], ..Frame::ZERO };
                change(index, &mut frame);
                values.extend(frame.to_channels());
            }
            read_table(&array("(3, 50)", &values), Format::Npy)
        };
        assert!(read(&|_, _| {}).unwrap().warnings.is_empty());
        let error = read(&|_, frame| frame.joint_angles_rad[20] = -40.0).unwrap_err().to_string();
        assert!(error.starts_with("frame 0: LKx_joint is -40 rad") && error.contains("degrees"), "{error}");
        let warnings =
            read(&|i, f| f.joint_angles_rad[20] = if i == 1 { -40.0 } else { 0.0 }).unwrap().warnings;
        assert!(warnings[0].contains("LKx_joint with -40 rad in frame 1"), "{warnings:?}");
        let error = read(&|_, frame| frame.root_position_m[2] = 912.0).unwrap_err().to_string();
        assert!(error.contains("912 m") && error.contains("millimetres"), "{error}");
        let warnings = read(&|_, frame| {
            frame.root_position_m = [0.0, 0.9, 0.1];
            frame.root_rotation_rad = [-1.5, 0.0, 0.0];
        });
        assert!(warnings.unwrap().warnings[0].contains("y up"));
    }
}
