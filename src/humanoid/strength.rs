//! Effort and velocity limits of the joints, from published human strength.
//!
//! A URDF limit is one constant for both directions and all postures, so each joint gets its stronger direction in its
//! best posture.
//! A torque beyond such a limit is one that hardly anybody can produce; a torque within it need not be possible.
//!
//! Torques are fractions of body weight times body height: strength scales with muscle force times lever arm, and the
//! torques that gravity asks for scale the same way.
//!
//! # Sources
//!
//! - **A**: Anderson, Madigan and Nussbaum 2007, J Biomech 40:3105, Table 3, as set G's program lists it: maximum voluntary
//!   torque per weight and height of 34 people; men of 18 to 25 years are used, mean plus two standard deviations.
//! - **G**: the whole-body torque set of Millard 2016 (`Millard2016TorqueMuscle` of the Rigid Body Dynamics Library), which
//!   joins the dynamometry of Jackson (an elite gymnast of 69.6 kg and 1.732 m), Kentel and others on that one man: largest
//!   isometric torque, and the speed at which the muscles produce none.
//! - **H**: Heiderscheit et al. 2011, Med Sci Sports Exerc 43:296, Table 3: peak moments per body mass of 45 runners at
//!   their own speed, mean plus two standard deviations.
//! - **F**: Fice, Siegmund and Blouin 2014, Ann Biomed Eng, doi 10.1007/s10439-014-1046-0: isometric neck moments of nine men, mean plus two
//!   standard deviations; their mass and height are not in the abstract and taken as 75 kg and 1.75 m.
//! - **T**: Goldmann et al. 2013, J Sports Sci 31:424: moment about the toe joints in a horizontal jump, per body mass.
//! - **S**: Grossman et al. 1988, Exp Brain Res, PMID 3384048: vigorous head turns of 20 people reach 780 degrees a second
//!   (median of their maxima).

use crate::motion::Body;

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.81;

/// How far torque can rise above its largest isometric value.
///
/// Muscle resists being stretched with more force than it can shorten against.
/// The largest such ratio in set G is 1.39; its authors put what is known between 1.0 and 1.4.
const ECCENTRIC_FACTOR: f64 = 1.4;

/// How far a joint can turn faster than the muscles across it can shorten.
///
/// In kicks and throws the motion of the neighbouring segments drives the joint.
/// The factor is ours; it puts the knee at 1650 degrees a second.
/// A baseball pitch (shoulder rotation up to 7700 degrees a second; Seroyer et al. 2010, Sports Health, PMC3445080) is
/// beyond it.
const WHIP_FACTOR: f64 = 1.5;

/// Weight times height of the gymnast of set G, N m.
const GYMNAST_WEIGHT_HEIGHT: f64 = 69.6 * GRAVITY * 1.732;
/// Weight times height of a typical young man, for sources that name neither, N m.
const MAN_WEIGHT_HEIGHT: f64 = 75.0 * GRAVITY * 1.75;
/// Weight times height per body mass of such a man, N m/kg.
const MAN_WEIGHT_HEIGHT_PER_KG: f64 = GRAVITY * 1.75;

/// Limits of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Strength {
    /// Largest torque as a fraction of body weight times body height.
    torque_fraction: f64,
    /// Largest joint speed, rad/s.
    pub velocity_rad_s: f64,
}

impl Strength {
    /// Limits from an isometric torque and the speed at which the muscles produce none.
    const fn of_muscles(isometric_fraction: f64, shortening_rad_s: f64) -> Self {
        Self {
            torque_fraction: isometric_fraction * ECCENTRIC_FACTOR,
            velocity_rad_s: shortening_rad_s * WHIP_FACTOR,
        }
    }

    /// Largest torque of this body, N m.
    pub(super) fn effort_nm(&self, body: Body) -> f64 {
        self.torque_fraction * body.mass_kg * GRAVITY * body.height_m
    }
}

/// Limits of the joint with this KIT short name; `None` for a name that is not KIT's.
pub(super) fn strength(short_name: &str) -> Option<Strength> {
    let muscles = Strength::of_muscles;
    Some(match short_name {
        // G, trunk flexion 211.65 N m, and 1.3 times that for extension upright (Beimborn and Morrissey 1988, as cited
        // there).
        // No figure for bending sideways or twisting could be found: they get that of flexion, from the same muscles.
        // Speed: back muscles, 433 degrees a second; the two joints share the spine's motion.
        "BPx" | "BTx" => muscles(1.3 * 211.65 / GYMNAST_WEIGHT_HEIGHT, 7.56),
        "BPy" | "BPz" | "BTy" | "BTz" => muscles(211.65 / GYMNAST_WEIGHT_HEIGHT, 7.56),
        // F: extension 51 (11), sideways 32 (9), turning 13 (5) N m.
        // S: 780 degrees a second.
        "BLNx" | "BUNx" => muscles(73.0 / MAN_WEIGHT_HEIGHT, 13.6),
        "BLNy" | "BUNy" => muscles(50.0 / MAN_WEIGHT_HEIGHT, 13.6),
        "BLNz" | "BUNz" => muscles(23.0 / MAN_WEIGHT_HEIGHT, 13.6),
        _ => match short_name.strip_prefix(['L', 'R'])? {
            // A: extension 0.161 (0.049). H: abduction 1.8 (0.4), rotation 0.6 (0.2) N m/kg. Speed: G.
            "Hx" => muscles(0.259, 9.18),
            "Hy" => muscles(2.6 / MAN_WEIGHT_HEIGHT_PER_KG, 9.18),
            "Hz" => muscles(1.0 / MAN_WEIGHT_HEIGHT_PER_KG, 9.18),
            // A: extension 0.163 (0.040). Speed: G.
            "Kx" => muscles(0.243, 19.2),
            // A: plantar flexion 0.095 (0.022). Speed: G.
            "Ax" => muscles(0.139, 17.3),
            // Sideways the ligaments of the foot carry what the muscles (some 35 N m) cannot.
            // The limit is what the ground can ask for: 2.5 times body weight at the edge of the sole, 28 mm at 1 m height.
            "Ay" | "Az" | "Mrot" => Strength { torque_fraction: 2.5 * 0.028, ..muscles(0.0, 17.3) },
            // T: 0.75 N m/kg. Speed: as the ankle.
            "Fx" => muscles(0.75 / MAN_WEIGHT_HEIGHT_PER_KG, 17.3),
            // G: horizontal adduction 128.5 N m, the strongest direction; any of the three axes can come to lie upright.
            // Holzbaur et al. 2007, J Biomech 40:2442: adductors of ten adults 67.9 (28.4) N m, which agrees.
            "Sx" | "Sy" | "Sz" => muscles(128.496 / GYMNAST_WEIGHT_HEIGHT, 19.1),
            // G: flexion 101.4, pronation 31.4 N m.
            "Ex" => muscles(101.384 / GYMNAST_WEIGHT_HEIGHT, 18.5),
            "Ez" => muscles(31.422 / GYMNAST_WEIGHT_HEIGHT, 21.8),
            // G: ulnar deviation 13.5, flexion 39.2 N m.
            "Wx" => muscles(13.536 / GYMNAST_WEIGHT_HEIGHT, 35.5),
            "Wy" => muscles(39.225 / GYMNAST_WEIGHT_HEIGHT, 36.5),
            _ => return None,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::JOINTS;

    #[test]
    fn every_joint_has_limits_and_left_equals_right() {
        for joint in &JOINTS {
            let limits = strength(joint.short_name()).unwrap();
            assert!(limits.torque_fraction > 0.0 && limits.velocity_rad_s > 0.0, "{}", joint.name);
            if let Some(rest) = joint.short_name().strip_prefix('L') {
                assert_eq!(strength(&format!("R{rest}")), Some(limits));
            }
        }
        assert_eq!(strength("Kx"), None);
        assert_eq!(strength("LQx"), None);
    }

    #[test]
    fn everyday_movement_stays_within_the_limits() {
        let body = Body::with_default_mass(1.75);
        // Rounded peaks of walking, running and landing from a jump, N m/kg.
        let peaks = [("LHx", 3.0), ("LHy", 2.0), ("LKx", 3.5), ("LAx", 3.0), ("BPx", 3.5), ("LFx", 0.8)];
        for (joint, torque_nm_per_kg) in peaks {
            let effort_nm = strength(joint).unwrap().effort_nm(body);
            assert!(effort_nm > torque_nm_per_kg * body.mass_kg, "{joint}: {effort_nm} N m");
        }
    }
}
