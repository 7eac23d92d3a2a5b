//! Numbers of the body: segments, joints, masses, shapes.
//!
//! Offsets, masses, centres of mass and inertias are facts of the MMM (Master Motor Map) whole-body reference model:
//! lengths for a subject of 1 m height (multiply by the body height H), masses as fractions of the body mass M, inertias
//! for 1 kg and 1 m (multiply by M H^2).
//! Shapes are ours: simple solids that follow the same bone lengths.
//!
//! Frames: x right, y forward, z up in the neutral pose, origin at the joint nearest to the root.

/// A block of the foot between two corners in the ankle frame of the neutral pose, millimetres at H = 1 m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    pub min_mm: [f64; 3],
    pub max_mm: [f64; 3],
}

impl Block {
    /// Volume at H = 1 m, cubic millimetres.
    pub(super) fn volume_mm3(&self) -> f64 {
        (0..3).map(|axis| self.max_mm[axis] - self.min_mm[axis]).product()
    }

    const fn mirrored(self) -> Self {
        Self {
            min_mm: [-self.max_mm[0], self.min_mm[1], self.min_mm[2]],
            max_mm: [-self.min_mm[0], self.max_mm[1], self.max_mm[2]],
        }
    }
}

/// A solid that stands for a segment in contacts and pictures.
#[derive(Debug, Clone, Copy)]
pub(super) enum Solid {
    /// Cylinder with half a sphere on either end, from `from_mm` to `to_mm` (the centres of the two spheres), in the frame
    /// of the segment, millimetres at H = 1 m.
    Capsule { from_mm: [f64; 3], to_mm: [f64; 3], radius_mm: f64 },
    /// Block of the foot.
    Block(Block),
}

/// How mass is known.
#[derive(Debug, Clone, Copy)]
pub(super) enum Mass {
    /// Fraction of body mass, centre of mass in the segment (mm at H = 1 m) and the moments of inertia about it along the
    /// axes of the segment (kg m^2 at 1 kg, 1 m).
    Known { fraction: f64, com_mm: [f64; 3], inertia: [f64; 3] },
    /// Share of the foot's mass by the volume of the block, as a uniform solid.
    ///
    /// Deviation: the MMM model gives midfoot and toes no mass; without some the body cannot be simulated forward.
    ShareOfFoot(Block),
}

/// A rigid body segment and the chain of revolute joints above it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    /// Link name.
    pub name: &'static str,
    /// Link name of the parent segment; empty for the root.
    pub parent: &'static str,
    /// Where the chain is fixed to the parent, millimetres at H = 1 m, in the parent's frame.
    pub offset_mm: [f64; 3],
    /// Rotation of the joint frame in the parent's frame, row by row.
    pub rotation: [[f64; 3]; 3],
    /// KIT short names of the joints of the chain, from parent to child.
    pub chain: &'static [&'static str],
    /// Masses that make up the segment; several are added.
    pub masses: &'static [Mass],
    /// Solids of the segment.
    pub solids: &'static [Solid],
}

const NONE: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Fraction of body mass in one whole foot.
pub(super) const FOOT_MASS_FRACTION: f64 = 0.013;

/// Height of the root (hip centres) above the sole in the neutral pose, as a fraction of body height.
pub const ROOT_HEIGHT_FRACTION: f64 = 0.530;

const fn known(fraction: f64, com_mm: [f64; 3], inertia: [f64; 3]) -> Mass {
    Mass::Known { fraction, com_mm, inertia }
}

const fn capsule(from_mm: [f64; 3], to_mm: [f64; 3], radius_mm: f64) -> Solid {
    Solid::Capsule { from_mm, to_mm, radius_mm }
}

/// The 21 segments, each after its parent.
#[rustfmt::skip]
pub(super) const SEGMENTS: [Segment; 21] = [
    Segment {
        name: "pelvis", parent: "", offset_mm: [0.0, 0.0, 0.0], rotation: NONE, chain: &[],
        masses: &[known(0.11, [0.0, 0.0, 4.2], [0.000_213_504, 0.000_346_519, 0.000_329_859])],
        solids: &[capsule([-45.0, 0.0, 12.0], [45.0, 0.0, 12.0], 52.0)],
    },
    Segment {
        name: "abdomen", parent: "pelvis", offset_mm: [0.0, 0.0, 40.0], rotation: NONE, chain: &["BPx", "BPz", "BPy"],
        masses: &[known(0.1, [0.0, 0.0, 26.4], [0.000_107_917, 0.000_107_917, 0.000_077_449_4])],
        solids: &[capsule([-32.0, 0.0, 26.0], [32.0, 0.0, 26.0], 52.0)],
    },
    Segment {
        name: "thorax", parent: "abdomen", offset_mm: [0.0, 0.0, 60.0], rotation: NONE, chain: &["BTx", "BTz", "BTy"],
        masses: &[
            known(0.17, [0.0, 0.0, 154.16], [0.000_662_659, 0.000_831_018, 0.000_469_138]),
            // The shoulder girdles, which KIT motions do not move.
            known(0.021, [-100.0, 0.0, 188.0], [0.000_004_092_02, 0.000_005_539_35, 0.000_005_209_45]),
            known(0.021, [100.0, 0.0, 188.0], [0.000_004_074_31, 0.000_005_507_3, 0.000_005_185_68]),
        ],
        solids: &[
            capsule([-38.0, 0.0, 65.0], [38.0, 0.0, 65.0], 55.0),
            capsule([-42.0, 0.0, 120.0], [42.0, 0.0, 120.0], 60.0),
            capsule([-85.0, 0.0, 184.0], [85.0, 0.0, 184.0], 27.0),
        ],
    },
    Segment {
        name: "neck", parent: "thorax", offset_mm: [0.0, 0.0, 210.0], rotation: NONE, chain: &["BLNx", "BLNz", "BLNy"],
        masses: &[known(0.024, [0.0, 0.0, 15.0], [0.000_004_974_4, 0.000_004_796_95, 0.000_003_810_92])],
        solids: &[capsule([0.0, 0.0, 5.0], [0.0, 0.0, 30.0], 30.0)],
    },
    Segment {
        name: "head", parent: "neck", offset_mm: [0.0, 0.0, 30.0], rotation: NONE, chain: &["BUNx", "BUNz", "BUNy"],
        masses: &[known(0.07, [0.0, 0.0, 65.0], [0.000_099_246_8, 0.000_096_884_4, 0.000_045_526_1])],
        solids: &[capsule([0.0, 6.0, 55.0], [0.0, 6.0, 80.0], 50.0)],
    },
    Segment {
        name: "left_upper_arm", parent: "thorax", offset_mm: [-110.0, 0.0, 188.0], rotation: NONE, chain: &["LSx", "LSz", "LSy"],
        masses: &[known(0.027, [0.0, 0.0, -82.0], [0.000_059_006_3, 0.000_059_008_6, 0.000_003_962_11])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -188.0], 26.0)],
    },
    Segment {
        name: "left_forearm", parent: "left_upper_arm", offset_mm: [0.0, 0.0, -188.0], rotation: NONE, chain: &["LEx", "LEz"],
        masses: &[known(0.016, [0.0, 0.0, -62.4], [0.000_023_558_6, 0.000_023_34, 0.000_001_506_84])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -145.0], 20.0)],
    },
    Segment {
        name: "left_hand", parent: "left_forearm", offset_mm: [0.0, 0.0, -145.0], rotation: NONE, chain: &["LWx", "LWy"],
        masses: &[known(0.006, [0.0, 0.0, -54.6], [0.000_005_196_3, 0.000_003_912_21, 0.000_001_418_14])],
        solids: &[capsule([0.0, 0.0, -20.0], [0.0, 0.0, -88.0], 17.0)],
    },
    Segment {
        name: "right_upper_arm", parent: "thorax", offset_mm: [110.0, 0.0, 188.0], rotation: NONE, chain: &["RSx", "RSz", "RSy"],
        masses: &[known(0.027, [0.020_4, 0.0, -82.0], [0.000_059_006_3, 0.000_059_008_6, 0.000_003_962_11])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -188.0], 26.0)],
    },
    Segment {
        name: "right_forearm", parent: "right_upper_arm", offset_mm: [0.0, 0.0, -188.0], rotation: NONE, chain: &["REx", "REz"],
        masses: &[known(0.016, [0.020_4, 0.0, -62.4], [0.000_023_558_6, 0.000_023_34, 0.000_001_506_84])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -145.0], 20.0)],
    },
    Segment {
        name: "right_hand", parent: "right_forearm", offset_mm: [0.0, 0.0, -145.0], rotation: NONE, chain: &["RWx", "RWy"],
        masses: &[known(0.006, [0.020_4, 0.0, -54.6], [0.000_005_188, 0.000_003_902_22, 0.000_001_419_93])],
        solids: &[capsule([0.0, 0.0, -20.0], [0.0, 0.0, -88.0], 17.0)],
    },
    Segment {
        name: "left_thigh", parent: "pelvis", offset_mm: [-52.0, 0.0, 0.0], rotation: NONE, chain: &["LHx", "LHz", "LHy"],
        masses: &[known(0.14, [0.0, 0.0, -123.4], [0.000_606_824, 0.000_601_201, 0.000_093_061_4])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -200.0], 45.0), capsule([0.0, 0.0, -200.0], [0.0, 0.0, -245.0], 33.0)],
    },
    Segment {
        name: "left_shank", parent: "left_thigh", offset_mm: [0.0, 0.0, -245.0], rotation: NONE, chain: &["LKx"],
        masses: &[known(0.04, [0.0, 0.0, -106.5], [0.000_177_607, 0.000_177_607, 0.000_008_149_56])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -150.0], 31.0), capsule([0.0, 0.0, -150.0], [0.0, 0.0, -246.0], 21.0)],
    },
    Segment {
        name: "left_foot", parent: "left_shank", offset_mm: [0.0, 0.0, -246.0], rotation: NONE, chain: &["LAx", "LAz", "LAy"],
        masses: &[Mass::ShareOfFoot(LEFT_HEEL)],
        solids: &[Solid::Block(LEFT_HEEL)],
    },
    Segment {
        name: "left_midfoot", parent: "left_foot", offset_mm: [0.6, 23.8, -18.7],
        rotation: [[0.987_688, 0.151_104, -0.040_488], [-0.156_434, 0.954_034, -0.255_633], [0.0, 0.258_819, 0.965_926]],
        chain: &["LMrot"],
        masses: &[Mass::ShareOfFoot(LEFT_BALL)],
        solids: &[Solid::Block(LEFT_BALL)],
    },
    Segment {
        name: "left_toes", parent: "left_midfoot", offset_mm: [-8.8, 53.7, -14.4],
        rotation: [[0.987_688, -0.151_104, -0.040_488], [0.156_434, 0.954_034, 0.255_633], [0.0, -0.258_819, 0.965_926]],
        chain: &["LFx"],
        masses: &[Mass::ShareOfFoot(LEFT_TOES)],
        solids: &[Solid::Block(LEFT_TOES)],
    },
    Segment {
        name: "right_thigh", parent: "pelvis", offset_mm: [52.0, 0.0, 0.0], rotation: NONE, chain: &["RHx", "RHz", "RHy"],
        masses: &[known(0.14, [0.045_6, 0.0, -123.4], [0.000_606_824, 0.000_601_201, 0.000_093_061_4])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -200.0], 45.0), capsule([0.0, 0.0, -200.0], [0.0, 0.0, -245.0], 33.0)],
    },
    Segment {
        name: "right_shank", parent: "right_thigh", offset_mm: [0.0, 0.0, -245.0], rotation: NONE, chain: &["RKx"],
        masses: &[known(0.04, [0.0, 0.0, -106.5], [0.000_177_607, 0.000_177_607, 0.000_008_149_56])],
        solids: &[capsule([0.0, 0.0, 0.0], [0.0, 0.0, -150.0], 31.0), capsule([0.0, 0.0, -150.0], [0.0, 0.0, -246.0], 21.0)],
    },
    Segment {
        name: "right_foot", parent: "right_shank", offset_mm: [0.0, 0.0, -246.0], rotation: NONE, chain: &["RAx", "RAz", "RAy"],
        masses: &[Mass::ShareOfFoot(RIGHT_HEEL)],
        solids: &[Solid::Block(RIGHT_HEEL)],
    },
    Segment {
        name: "right_midfoot", parent: "right_foot", offset_mm: [0.6, 23.8, -18.7],
        rotation: [[0.987_688, -0.151_104, 0.040_488], [0.156_434, 0.954_034, -0.255_633], [0.0, 0.258_819, 0.965_926]],
        chain: &["RMrot"],
        masses: &[Mass::ShareOfFoot(RIGHT_BALL)],
        solids: &[Solid::Block(RIGHT_BALL)],
    },
    Segment {
        name: "right_toes", parent: "right_midfoot", offset_mm: [8.8, 53.7, -14.392_2],
        rotation: [[0.987_688, 0.151_104, 0.040_488], [-0.156_434, 0.954_034, 0.255_633], [0.0, -0.258_819, 0.965_926]],
        chain: &["RFx"],
        masses: &[Mass::ShareOfFoot(RIGHT_TOES)],
        solids: &[Solid::Block(RIGHT_TOES)],
    },
];

// The three blocks of a foot; the sole lies 39 mm below the ankle.
// Their outlines fit the contact points of recorded stance: heel, ball and toes all reach the floor.
const LEFT_HEEL: Block = Block { min_mm: [-17.0, -40.0, -39.0], max_mm: [17.0, 22.0, 5.0] };
const LEFT_BALL: Block = Block { min_mm: [-28.0, 22.0, -39.0], max_mm: [24.0, 72.0, -12.0] };
const LEFT_TOES: Block = Block { min_mm: [-20.0, 76.0, -39.0], max_mm: [22.0, 109.0, -21.0] };
const RIGHT_HEEL: Block = LEFT_HEEL.mirrored();
const RIGHT_BALL: Block = LEFT_BALL.mirrored();
const RIGHT_TOES: Block = LEFT_TOES.mirrored();
