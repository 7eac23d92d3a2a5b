//! From the elements of an MMM file to a motion.
//!
//! Legacy: `<Motion>` holds `<JointOrder>` and `<MotionFrames>`, one `<MotionFrame>` per instant.
//! v2.0: `<Motion>` holds `<Sensors>`; the `ModelPose` sensor has the root, each `Kinematic` sensor its joints.

use super::joint_order::{JointOrder, JointOrderError, MAX_JOINTS};
use super::xml::Cursor;
use super::{MmmError, MmmFault, MmmMotion, PLACEHOLDER_MASS_KG, clock};
use crate::motion::{Body, Frame, Motion, MotionError, bounds};

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

/// Fills `values` from the numbers of the element just opened.
fn read_numbers(
    cursor: &mut Cursor<'_>,
    element: &'static str,
    place: impl Fn() -> String,
    values: &mut [f64],
) -> Result<(), MmmError> {
    let mut found = 0;
    cursor.numbers(
        element,
        |value| {
            if let Some(slot) = values.get_mut(found) {
                *slot = value;
            }
            found += 1;
        },
        |word| MmmFault::NotANumber { place: place(), element, found: word.found },
    )?;
    let expected = values.len();
    if found == expected {
        return Ok(());
    }
    Err(cursor.fault(MmmFault::NumberCount { place: place(), element, expected, found }))
}

/// Elements of one frame, each of which must stand exactly once.
#[derive(Default)]
struct Seen(Vec<&'static str>);

impl Seen {
    fn once(&mut self, cursor: &Cursor<'_>, element: &'static str, frame: usize) -> Result<(), MmmError> {
        if self.0.contains(&element) {
            return Err(cursor.fault(MmmFault::Repeated { place: frame_place(frame), element }));
        }
        self.0.push(element);
        Ok(())
    }

    fn all(&self, cursor: &Cursor<'_>, elements: &[&'static str], frame: usize) -> Result<(), MmmError> {
        match elements.iter().find(|element| !self.0.contains(element)) {
            None => Ok(()),
            Some(element) => Err(cursor.fault(MmmFault::Missing { place: frame_place(frame), element })),
        }
    }
}

fn frame_place(frame: usize) -> String {
    format!("frame {frame}")
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
            read_numbers(cursor, element, || PLACE.to_owned(), &mut value)?;
            if slot.replace(value[0]).is_some() {
                return Err(cursor.fault(MmmFault::Repeated { place: PLACE.to_owned(), element }));
            }
        }
        Ok(())
    }

    fn read_frames(&mut self, cursor: &mut Cursor<'_>) -> Result<(), MmmError> {
        self.order.check().map_err(|error| cursor.fault(error))?;
        let mut columns = [0.0; MAX_JOINTS];
        let columns = &mut columns[..self.order.num_columns()];
        let mut seen = Seen::default();
        while let Some(start) = cursor.child_element("MotionFrames")? {
            if start.name().as_ref() != "MotionFrame" {
                cursor.skip()?;
                continue;
            }
            let index = self.frames.len();
            let place = || frame_place(index);
            let mut frame = Frame::ZERO;
            let mut stamp = [0.0];
            seen.0.clear();
            while let Some(start) = cursor.child_element("MotionFrame")? {
                match start.name().as_ref() {
                    "Timestep" => {
                        seen.once(cursor, "Timestep", index)?;
                        read_numbers(cursor, "Timestep", place, &mut stamp)?;
                    }
                    "RootPosition" => {
                        seen.once(cursor, "RootPosition", index)?;
                        read_numbers(cursor, "RootPosition", place, &mut frame.root_position_m)?;
                    }
                    "RootRotation" => {
                        seen.once(cursor, "RootRotation", index)?;
                        read_numbers(cursor, "RootRotation", place, &mut frame.root_rotation_rad)?;
                    }
                    "JointPosition" => {
                        seen.once(cursor, "JointPosition", index)?;
                        read_numbers(cursor, "JointPosition", place, columns)?;
                        self.order.scatter(columns, &mut frame.joint_angles_rad);
                    }
                    _ => cursor.skip()?,
                }
            }
            seen.all(cursor, &["Timestep", "RootPosition", "RootRotation", "JointPosition"], index)?;
            *self.frame_mut(cursor, index)? = frame;
            self.stamps_secs.push(stamp[0]);
        }
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
                    self.stamps_secs = self.read_sensor(cursor, None)?;
                }
                "Kinematic" => {
                    let stamps = self.read_sensor(cursor, Some(JointOrder::default()))?;
                    self.kinematic_stamps_secs.push(stamps);
                }
                _ => cursor.skip()?,
            }
        }
        Ok(())
    }

    /// Reads a sensor into the frames and returns its time stamps; kinematic sensors have a joint order of their own.
    fn read_sensor(
        &mut self,
        cursor: &mut Cursor<'_>,
        mut order: Option<JointOrder>,
    ) -> Result<Vec<f64>, MmmError> {
        let mut stamps_secs = Vec::new();
        while let Some(start) = cursor.child_element("Sensor")? {
            match (start.name().as_ref(), &mut order) {
                ("Configuration", Some(order)) => read_joints(cursor, "Configuration", order)?,
                ("Data", Some(order)) if order.num_columns() == 0 => {
                    return Err(cursor.fault(JointOrderError::None));
                }
                ("Data", order) => {
                    while let Some(start) = cursor.child_element("Data")? {
                        if start.name().as_ref() != "Measurement" {
                            cursor.skip()?;
                            continue;
                        }
                        let frame = stamps_secs.len();
                        stamps_secs.push(read_stamp(cursor, &start, frame)?);
                        self.read_measurement(cursor, frame, order.as_ref())?;
                    }
                }
                _ => cursor.skip()?,
            }
        }
        if let Some(order) = order {
            self.order.merge(&order).map_err(|error| cursor.fault(error))?;
        }
        Ok(stamps_secs)
    }

    fn read_measurement(
        &mut self,
        cursor: &mut Cursor<'_>,
        index: usize,
        order: Option<&JointOrder>,
    ) -> Result<(), MmmError> {
        let place = || frame_place(index);
        let frame = self.frame_mut(cursor, index)?;
        let mut seen = Seen::default();
        while let Some(start) = cursor.child_element("Measurement")? {
            match (start.name().as_ref(), order) {
                ("RootPosition", None) => {
                    seen.once(cursor, "RootPosition", index)?;
                    read_numbers(cursor, "RootPosition", place, &mut frame.root_position_m)?;
                }
                ("RootRotation", None) => {
                    seen.once(cursor, "RootRotation", index)?;
                    read_numbers(cursor, "RootRotation", place, &mut frame.root_rotation_rad)?;
                }
                ("JointPosition", Some(order)) => {
                    seen.once(cursor, "JointPosition", index)?;
                    let mut columns = [0.0; MAX_JOINTS];
                    let columns = &mut columns[..order.num_columns()];
                    read_numbers(cursor, "JointPosition", place, columns)?;
                    order.scatter(columns, &mut frame.joint_angles_rad);
                }
                _ => cursor.skip()?,
            }
        }
        match order {
            None => seen.all(cursor, &["RootPosition", "RootRotation"], index),
            Some(_) => seen.all(cursor, &["JointPosition"], index),
        }
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
