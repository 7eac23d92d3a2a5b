//! A clip in our world: metres, z up, looking along y at rest, joints by role.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::floor::Floor;
use super::low_pass::low_pass;
use super::role::{NUM_ORIENTED, NUM_ROLES, ORIENTED};
use super::size::{Proportions, height_m};
use super::stance::FootPaths;
use super::{Correspondence, RetargetError, Role};
use crate::mocap::Clip;

/// Heights of bodies for which a length unit is believed, metres.
const BELIEVED_HEIGHT_M: std::ops::RangeInclusive<f64> = 1.2..=2.2;

/// Speed of a limb that is the work of a converter, radians per second, and the most frames it may last.
const BLEND_SPEED_RAD_S: f64 = 15.0;
const MAX_BLEND_FRAMES: usize = 8;

/// Share of the frames in which the toes may point backwards before left and right are taken for exchanged.
const BACKWARD_SHARE: f64 = 0.7;

/// One frame of the source.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourceFrame {
    /// Joint centres in the world, metres; what the skeleton lacks is NaN.
    pub centres: [Vector3<f64>; NUM_ROLES],
    /// Up and forward axes of our segments in the world, as the source's bones tell; NaN where they do not.
    pub axes: [[Vector3<f64>; 2]; NUM_ORIENTED],
}

impl SourceFrame {
    pub(super) fn centre(&self, role: Role) -> Vector3<f64> {
        self.centres[role.index()]
    }

    /// Middle of the hips, our root.
    pub(super) fn pelvis(&self) -> Vector3<f64> {
        (self.centre(Role::LeftHip) + self.centre(Role::RightHip)) / 2.0
    }
}

/// A recording by roles.
#[derive(Debug)]
pub(super) struct Source {
    pub frames: Vec<SourceFrame>,
    pub rate_hz: f64,
    pub has: [bool; NUM_ROLES],
    pub height_m: f64,
    pub notes: Vec<String>,
}

impl Source {
    pub(super) fn foot_paths(&self) -> FootPaths {
        let path = |role: Role| self.frames.iter().map(|frame| frame.centre(role)).collect();
        FootPaths {
            toes: [path(Role::LeftToe), path(Role::RightToe)],
            ankles: [path(Role::LeftAnkle), path(Role::RightAnkle)],
        }
    }
}

const NAN: Vector3<f64> = Vector3::new(f64::NAN, f64::NAN, f64::NAN);

impl Source {
    /// `height_m` overrides the height that the skeleton shows.
    pub(super) fn new(
        clip: &Clip,
        correspondence: &Correspondence,
        proportions: &Proportions,
        rate_hz: f64,
        stated_height_m: Option<f64>,
    ) -> Result<Self, RetargetError> {
        let missing = correspondence.missing_in(clip);
        if !missing.is_empty() {
            return Err(RetargetError::MissingJoints {
                skeleton: correspondence.name.clone(),
                joints: missing.into_iter().map(str::to_owned).collect(),
            });
        }
        let reader = Reader::new(clip, correspondence);
        let mut frames = Vec::with_capacity(clip.num_frames());
        let mut poses = Vec::new();
        for frame in 0..clip.num_frames() {
            clip.pose_into(frame, &mut poses);
            frames.push(reader.frame(&poses));
        }
        let mut notes = Vec::new();
        settle_start(&mut frames, rate_hz, &mut notes);
        low_pass(&mut frames, rate_hz);
        let mut has = [false; NUM_ROLES];
        for role in correspondence.joints.keys() {
            has[role.index()] = true;
        }
        if !clip.has_orientations() {
            exchange_sides(&mut frames, &mut notes);
        }

        let in_units = height_m(&frames, proportions).filter(|height| *height > 0.0);
        let Some(in_units) = in_units else { return Err(RetargetError::NoBody) };
        let units = &correspondence.unit_m;
        let Some(unit_m) = units.iter().find(|unit| BELIEVED_HEIGHT_M.contains(&(*unit * in_units))) else {
            return Err(RetargetError::Size {
                height_m: in_units * units[0],
                skeleton: correspondence.name.clone(),
            });
        };
        for frame in &mut frames {
            for centre in &mut frame.centres {
                *centre *= *unit_m;
            }
        }
        if *unit_m != units[0] {
            notes.push(format!(
                "one length unit is taken for {unit_m} m, since {} m would make a body of {:.2} m",
                units[0],
                in_units * units[0]
            ));
        }
        let height_m = stated_height_m.unwrap_or(in_units * unit_m);
        let mut source = Self { frames, rate_hz, has, height_m, notes };
        if !correspondence.same_body {
            source.level_floor();
        }
        Ok(source)
    }
}

impl Source {
    fn level_floor(&mut self) {
        if let Some(floor) = Floor::sloping(&self.foot_paths(), self.rate_hz) {
            floor.level(&mut self.frames);
            self.notes.push(format!(
                "the floor on which feet rest slopes by {:.1} degrees and is turned level",
                floor.slope_rad().to_degrees()
            ));
        }
    }
}

/// Where to find what in a pose.
struct Reader {
    world_from_file: UnitQuaternion<f64>,
    joints: Vec<(Role, Vec<(usize, f64)>)>,
    orientations: Vec<(usize, usize, [Vector3<f64>; 2])>,
}

impl Reader {
    fn new(clip: &Clip, correspondence: &Correspondence) -> Self {
        // Every name was found to be there.
        let index =
            |name: &str| clip.joints().iter().position(|joint| joint.name == name).unwrap_or_default();
        let (up, forward) = (correspondence.up.0, correspondence.forward.0);
        // Rows: what becomes x (right), y (forward) and z (up).
        let rows = [forward.cross(&up), forward, up].map(|row| row.transpose());
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&rows));
        Self {
            world_from_file: UnitQuaternion::from_rotation_matrix(&rotation),
            joints: correspondence
                .joints
                .iter()
                .map(|(role, joints)| {
                    (*role, joints.shares().into_iter().map(|(name, share)| (index(name), share)).collect())
                })
                .collect(),
            orientations: ORIENTED
                .iter()
                .enumerate()
                .filter(|_| clip.has_orientations())
                .filter_map(|(number, (segment, _))| {
                    let orientation = correspondence.orientations.get(segment)?;
                    let axes =
                        [orientation.up, orientation.forward].map(|axis| axis.map_or(NAN, |axis| axis.0));
                    Some((number, index(&orientation.joint), axes))
                })
                .collect(),
        }
    }

    fn frame(&self, poses: &[Isometry3<f64>]) -> SourceFrame {
        let mut frame = SourceFrame { centres: [NAN; NUM_ROLES], axes: [[NAN; 2]; NUM_ORIENTED] };
        for (role, joints) in &self.joints {
            let centre: Vector3<f64> =
                joints.iter().map(|&(joint, share)| poses[joint].translation.vector * share).sum();
            frame.centres[role.index()] = self.world_from_file * centre;
        }
        for (segment, joint, axes) in &self.orientations {
            let rotation = self.world_from_file * poses[*joint].rotation;
            frame.axes[*segment] = axes.map(|axis| rotation * axis);
        }
        frame
    }
}

/// Some converters begin with a pose of their own and blend or jump into the recording within a few frames: all frames up
/// to the last of these in which limbs turn faster than bodies do are replaced by those after it, in reverse: the movement
/// keeps its speed where the recording begins.
fn settle_start(frames: &mut [SourceFrame], rate_hz: f64, notes: &mut Vec<String>) {
    let limbs = [
        (Role::LeftShoulder, Role::LeftElbow),
        (Role::RightShoulder, Role::RightElbow),
        (Role::LeftHip, Role::LeftKnee),
        (Role::RightHip, Role::RightKnee),
    ];
    let speed = |pair: &[SourceFrame]| {
        let turn = |(from, to): (Role, Role)| {
            let bone = |frame: &SourceFrame| frame.centre(to) - frame.centre(from);
            bone(&pair[0]).angle(&bone(&pair[1])) * rate_hz
        };
        limbs.into_iter().map(turn).fold(0.0, f64::max)
    };
    let begin = &frames[..frames.len().min(MAX_BLEND_FRAMES + 1)];
    let fast = begin.windows(2).rposition(|pair| speed(pair) > BLEND_SPEED_RAD_S).map_or(0, |pair| pair + 1);
    if fast > 0 && fast < frames.len() - 1 {
        let settled = frames[fast];
        for back in 1..=fast {
            let ahead = frames[(fast + back).min(frames.len() - 1)];
            let frame = &mut frames[fast - back];
            for (centre, (at, after)) in
                frame.centres.iter_mut().zip(settled.centres.iter().zip(&ahead.centres))
            {
                *centre = at * 2.0 - after;
            }
            let axes = settled.axes.iter().flatten().zip(ahead.axes.iter().flatten());
            for (axis, (at, after)) in frame.axes.iter_mut().flatten().zip(axes) {
                let mirrored = at * 2.0 - after;
                *axis = mirrored.try_normalize(1e-6).unwrap_or(mirrored);
            }
        }
        notes.push(format!(
            "limbs turn faster than bodies do within the first {fast} frames, which what follows frame {fast} replaces"
        ));
    }
}

/// Arrays of positions exist with left and right exchanged, a mirror image of the body; the toes tell.
fn exchange_sides(frames: &mut [SourceFrame], notes: &mut Vec<String>) {
    let backward = |frame: &SourceFrame| {
        let right = frame.centre(Role::RightHip) - frame.centre(Role::LeftHip);
        let up = frame.centre(Role::Neck) - frame.pelvis();
        let forward = up.cross(&right);
        let toes = [(Role::LeftToe, Role::LeftAnkle), (Role::RightToe, Role::RightAnkle)];
        toes.iter().map(|(toe, ankle)| (frame.centre(*toe) - frame.centre(*ankle)).dot(&forward)).sum::<f64>()
            < 0.0
    };
    let count = frames.iter().filter(|frame| backward(frame)).count();
    if (count as f64) < BACKWARD_SHARE * frames.len() as f64 {
        return;
    }
    for frame in frames.iter_mut() {
        for left in Role::all().filter(|role| role.name().starts_with("left_")) {
            let right = Role::all()
                .find(|role| role.name().strip_prefix("right_") == left.name().strip_prefix("left_"));
            if let Some(right) = right {
                frame.centres.swap(left.index(), right.index());
            }
        }
    }
    notes.push("the toes point backwards, so left and right are taken for exchanged".to_owned());
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that stands still but for its left upper arm, which hangs down and swings at 1 rad/s.
    fn swinging(num_frames: usize, arm_rad: impl Fn(usize) -> f64) -> Vec<SourceFrame> {
        (0..num_frames)
            .map(|frame| {
                let mut source = SourceFrame {
                    centres: [-Vector3::z(); NUM_ROLES],
                    axes: [[Vector3::z(); 2]; NUM_ORIENTED],
                };
                for role in [Role::LeftShoulder, Role::RightShoulder, Role::LeftHip, Role::RightHip] {
                    source.centres[role.index()] = Vector3::zeros();
                }
                let arm = arm_rad(frame);
                source.centres[Role::LeftElbow.index()] = Vector3::new(0.0, arm.sin(), -arm.cos());
                source
            })
            .collect()
    }

    fn fastest_rad_s(frames: &[SourceFrame], rate_hz: f64) -> f64 {
        let arm = |frame: &SourceFrame| frame.centre(Role::LeftElbow) - frame.centre(Role::LeftShoulder);
        frames.windows(2).map(|pair| arm(&pair[0]).angle(&arm(&pair[1])) * rate_hz).fold(0.0, f64::max)
    }

    #[test]
    fn a_start_that_jumps_after_some_frames_is_replaced_too() {
        let rate_hz = 100.0;
        for jump in 0..=7 {
            let mut frames =
                swinging(50, |frame| 0.01 * frame as f64 + if frame <= jump { 1.6 } else { 0.0 });
            let recorded = frames[jump + 1..].to_vec();
            let mut notes = Vec::new();
            settle_start(&mut frames, rate_hz, &mut notes);
            assert!((fastest_rad_s(&frames, rate_hz) - 1.0).abs() < 0.01, "jump after frame {jump}");
            assert_eq!(notes.len(), 1);
            let kept = frames[jump + 1..].iter().zip(&recorded);
            assert!(kept.into_iter().all(|(a, b)| a.centre(Role::LeftElbow) == b.centre(Role::LeftElbow)));
        }
    }

    #[test]
    fn a_start_that_moves_as_bodies_do_is_left_alone() {
        let mut frames = swinging(50, |frame| 0.1 * frame as f64);
        let mut notes = Vec::new();
        settle_start(&mut frames, 100.0, &mut notes);
        assert!(notes.is_empty() && (fastest_rad_s(&frames, 100.0) - 10.0).abs() < 1e-6);
    }
}
