//! From the elements of an MMM file to a motion.
//!
//! Legacy: `<Motion>` holds `<JointOrder>` and `<MotionFrames>`, one `<MotionFrame>` per instant.
//! v2.0: `<Motion>` holds `<Sensors>`; the `ModelPose` sensor has the root, each `Kinematic` sensor its joints.

use super::frame::{
    FrameReader, KINEMATIC_MEASUREMENT, LEGACY_FRAME, POSE_MEASUREMENT, frame_place, read_numbers,
};
use super::joint_order::{JointOrder, JointOrderError};
use super::xml::Cursor;
use super::{MmmError, MmmFault, MmmMotion, PLACEHOLDER_MASS_KG, clock};
use crate::motion::{Body, Frame, Motion, MotionError, NUM_CHANNELS, bounds};

const METRES_PER_MILLIMETRE: f64 = 1e-3;

/// Root height below which a file is suspected to be in metres already, metres after conversion: 5 mm.
const SUSPICIOUS_HEIGHT_M: f64 = 0.005;

/// Reads an MMM file.
///
/// The body has the height of the file and `mass_kg`; without it, the mass of the file, unless that is missing or the
/// placeholder ([`PLACEHOLDER_MASS_KG`]), which [`Body::with_default_mass`] replaces.
/// Of several motions in a file the first is read, with a warning.
///
/// # Errors
/// [`MmmError`] names the line and the reason.
pub fn read_mmm(xml: &[u8], mass_kg: Option<f64>) -> Result<MmmMotion, MmmError> {
    let mut cursor = Cursor::new(xml);
    cursor.root("MMM")?;
    let mut content = None;
    let mut ignored = 0;
    while let Some(start) = cursor.child_element("MMM")? {
        match start.name().as_ref() {
            "Motion" if content.is_none() => {
                let name = cursor.attribute(&start, "name")?.unwrap_or_default();
                content = Some(read_motion(&mut cursor, name)?);
            }
            "Motion" => {
                ignored += 1;
                cursor.skip()?;
            }
            _ => cursor.skip()?,
        }
    }
    cursor.finish()?;
    let content = content.ok_or_else(|| cursor.fault(MmmFault::NoMotion))?;
    let mut read = content.finish(mass_kg).map_err(|fault| cursor.fault(fault))?;
    if ignored > 0 {
        read.warnings.push(format!("the file has {} motions; only the first is read", ignored + 1));
    }
    Ok(read)
}

/// What `<Motion>` says, not yet a motion.
#[derive(Default)]
struct Content {
    name: String,
    height_m: Option<f64>,
    mass_kg: Option<f64>,
    order: JointOrder,
    frames: Vec<Frame>,
    stamps_secs: Vec<f64>,
    /// The frames come from sensors.
    has_pose: bool,
    /// Time stamps of each kinematic sensor.
    kinematic_stamps_secs: Vec<Vec<f64>>,
}

fn read_motion(cursor: &mut Cursor<'_>, name: String) -> Result<Content, MmmError> {
    let mut content = Content { name, ..Content::default() };
    while let Some(start) = cursor.child_element("Motion")? {
        match start.name().as_ref() {
            "ModelProcessorConfig" => content.read_body(cursor)?,
            "Model" => {
                while let Some(start) = cursor.child_element("Model")? {
                    match start.name().as_ref() {
                        "ModelProcessorConfig" => content.read_body(cursor)?,
                        _ => cursor.skip()?,
                    }
                }
            }
            "JointOrder" => read_joints(cursor, "JointOrder", &mut content.order)?,
            "MotionFrames" => content.read_frames(cursor)?,
            "Sensors" if content.frames.is_empty() => content.read_sensors(cursor)?,
            "Sensors" => {
                return Err(
                    cursor.fault(MmmFault::Unexpected { element: "Motion", found: "Sensors".to_owned() })
                );
            }
            _ => cursor.skip()?,
        }
    }
    Ok(content)
}

/// Adds the joints listed in `element`; v2.0 files list them in `Configuration`, some within a `JointOrder` there.
fn read_joints(
    cursor: &mut Cursor<'_>,
    element: &'static str,
    order: &mut JointOrder,
) -> Result<(), MmmError> {
    while let Some(start) = cursor.child_element(element)? {
        match start.name().as_ref() {
            "Joint" => {
                if let Some(name) = cursor.attribute(&start, "name")? {
                    order.push(name).map_err(|error| cursor.fault(error))?;
                }
                cursor.skip()?;
            }
            "JointOrder" if element == "Configuration" => read_joints(cursor, "JointOrder", order)?,
            _ => cursor.skip()?,
        }
    }
    Ok(())
}

impl Content {
    fn read_body(&mut self, cursor: &mut Cursor<'_>) -> Result<(), MmmError> {
        const PLACE: &str = "ModelProcessorConfig";
        while let Some(start) = cursor.child_element(PLACE)? {
            let (element, slot) = match start.name().as_ref() {
                "Height" => ("Height", &mut self.height_m),
                "Mass" => ("Mass", &mut self.mass_kg),
                _ => {
                    cursor.skip()?;
                    continue;
                }
            };
            let mut value = [0.0];
            read_numbers(cursor, element, None, || PLACE.to_owned(), &mut value)?;
            if slot.replace(value[0]).is_some() {
                return Err(cursor.fault(MmmFault::Repeated { place: PLACE.to_owned(), element }));
            }
        }
        Ok(())
    }

    fn read_frames(&mut self, cursor: &mut Cursor<'_>) -> Result<(), MmmError> {
        self.order.check().map_err(|error| cursor.fault(error))?;
        let order = std::mem::take(&mut self.order);
        let mut reader = FrameReader::new("MotionFrame", LEGACY_FRAME, &order);
        while let Some(start) = cursor.child_element("MotionFrames")? {
            if start.name().as_ref() != "MotionFrame" {
                cursor.skip()?;
                continue;
            }
            let (index, before) = (self.frames.len(), cursor.remaining());
            let stamp_secs = reader.read(cursor, index, self.frame_mut(cursor, index)?)?;
            self.stamps_secs.push(stamp_secs);
            if index == 0 {
                // The other frames are about as long; one that is valid has at least a byte for each number.
                let expected = cursor.remaining() / (before - cursor.remaining()).max(NUM_CHANNELS);
                self.frames.reserve(expected);
            }
        }
        self.order = order;
        Ok(())
    }

    fn read_sensors(&mut self, cursor: &mut Cursor<'_>) -> Result<(), MmmError> {
        while let Some(start) = cursor.child_element("Sensors")? {
            let kind = match start.name().as_ref() {
                "Sensor" => cursor.attribute(&start, "type")?.unwrap_or_default(),
                _ => String::new(),
            };
            match kind.as_str() {
                "ModelPose" if self.has_pose => {
                    let place = "<Sensors>".to_owned();
                    return Err(cursor.fault(MmmFault::Repeated { place, element: "ModelPose sensor" }));
                }
                "ModelPose" => {
                    self.has_pose = true;
                    self.stamps_secs = self.read_pose(cursor)?;
                }
                "Kinematic" => {
                    let stamps = self.read_kinematic(cursor)?;
                    self.kinematic_stamps_secs.push(stamps);
                }
                _ => cursor.skip()?,
            }
        }
        Ok(())
    }

    /// Reads the pose sensor into the frames and returns its time stamps.
    fn read_pose(&mut self, cursor: &mut Cursor<'_>) -> Result<Vec<f64>, MmmError> {
        let mut stamps_secs = Vec::new();
        let order = JointOrder::default();
        while let Some(start) = cursor.child_element("Sensor")? {
            match start.name().as_ref() {
                "Data" => {
                    let reader = FrameReader::new("Measurement", POSE_MEASUREMENT, &order);
                    self.read_measurements(cursor, reader, &mut stamps_secs)?;
                }
                _ => cursor.skip()?,
            }
        }
        Ok(stamps_secs)
    }

    /// Reads a kinematic sensor, which has a joint list of its own, into the frames and returns its time stamps.
    fn read_kinematic(&mut self, cursor: &mut Cursor<'_>) -> Result<Vec<f64>, MmmError> {
        let mut stamps_secs = Vec::new();
        let mut order = JointOrder::default();
        while let Some(start) = cursor.child_element("Sensor")? {
            match start.name().as_ref() {
                "Configuration" => read_joints(cursor, "Configuration", &mut order)?,
                "Data" if order.num_columns() == 0 => return Err(cursor.fault(JointOrderError::None)),
                "Data" => {
                    let reader = FrameReader::new("Measurement", KINEMATIC_MEASUREMENT, &order);
                    self.read_measurements(cursor, reader, &mut stamps_secs)?;
                }
                _ => cursor.skip()?,
            }
        }
        self.order.merge(&order).map_err(|error| cursor.fault(error))?;
        Ok(stamps_secs)
    }

    fn read_measurements(
        &mut self,
        cursor: &mut Cursor<'_>,
        mut reader: FrameReader<'_>,
        stamps_secs: &mut Vec<f64>,
    ) -> Result<(), MmmError> {
        while let Some(start) = cursor.child_element("Data")? {
            if start.name().as_ref() != "Measurement" {
                cursor.skip()?;
                continue;
            }
            let index = stamps_secs.len();
            stamps_secs.push(read_stamp(cursor, &start, index)?);
            reader.read(cursor, index, self.frame_mut(cursor, index)?)?;
        }
        Ok(())
    }

    /// The frame at `index`, which is one of the frames there are or the next.
    fn frame_mut(&mut self, cursor: &Cursor<'_>, index: usize) -> Result<&mut Frame, MmmError> {
        if index == self.frames.len() {
            if index == bounds::MAX_FRAMES {
                return Err(cursor.fault(MotionError::TooLong { found: index + 1 }));
            }
            self.frames.push(Frame::ZERO);
        }
        Ok(&mut self.frames[index])
    }

    fn finish(mut self, mass_kg: Option<f64>) -> Result<MmmMotion, MmmFault> {
        let mut warnings: Vec<String> = self.order.check()?.into_iter().collect();
        self.check_sensors()?;
        if self.frames.is_empty() {
            return Err(MotionError::Empty.into());
        }
        let rate_hz = clock::rate_from_stamps(&self.stamps_secs)?;
        let height_m = self.height_m.ok_or_else(|| MmmFault::Missing {
            place: "the <ModelProcessorConfig> of the motion".to_owned(),
            element: "Height",
        })?;
        let mut body = Body::with_default_mass(height_m);
        let stated_mass_kg = mass_kg.or(self.mass_kg.filter(|&mass| mass != PLACEHOLDER_MASS_KG));
        body.mass_kg = stated_mass_kg.unwrap_or(body.mass_kg);

        for frame in &mut self.frames {
            frame.root_position_m = frame.root_position_m.map(|position| position * METRES_PER_MILLIMETRE);
        }
        let low = |frame: &&Frame| frame.root_position_m[2].abs() < SUSPICIOUS_HEIGHT_M;
        if 2 * self.frames.iter().filter(low).count() > self.frames.len() {
            warnings.push(
                "the root is within 5 mm of the floor in most frames: are the positions in metres? \
                 MMM files are in millimetres"
                    .to_owned(),
            );
        }
        let motion = Motion::new(body, rate_hz, self.frames)?;
        Ok(MmmMotion { name: self.name, motion, warnings })
    }

    /// All sensors must have measured the same frames.
    fn check_sensors(&self) -> Result<(), MmmFault> {
        if self.kinematic_stamps_secs.is_empty() {
            return Ok(());
        }
        if !self.has_pose {
            return Err(MmmFault::Missing {
                place: "<Sensors>".to_owned(),
                element: "Sensor type=\"ModelPose\"",
            });
        }
        for stamps in &self.kinematic_stamps_secs {
            let differs = |found: String, expected: String| {
                Err(MmmFault::Sensors { sensor: "Kinematic", found, expected })
            };
            if stamps.len() != self.stamps_secs.len() {
                return differs(format!("{} measurements", stamps.len()), self.stamps_secs.len().to_string());
            }
            // One writer prints both alike; NaN is never within the tolerance.
            let same = |found: f64, expected: f64| (found - expected).abs() <= 1e-6;
            let mut pairs = stamps.iter().zip(&self.stamps_secs).enumerate();
            if let Some((frame, (found, expected))) = pairs.find(|(_, (a, b))| !same(**a, **b)) {
                return differs(format!("time stamp {found} s at frame {frame}"), format!("{expected} s"));
            }
        }
        Ok(())
    }
}

fn read_stamp<'a>(
    cursor: &Cursor<'a>,
    start: &quick_xml::events::BytesStart<'a>,
    frame: usize,
) -> Result<f64, MmmError> {
    let place = frame_place(frame);
    let Some(text) = cursor.attribute(start, "timestep")? else {
        return Err(cursor.fault(MmmFault::Missing { place, element: "Measurement timestep=\"...\"" }));
    };
    text.trim().parse().map_err(|_| {
        cursor.fault(MmmFault::NotANumber { place, element: "Measurement", found: text.clone() })
    })
}
