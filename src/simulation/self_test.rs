//! Does the engine do what physics says, in this build and with these settings?
//!
//! Small experiments with known answers, run before anything is scored.
//! Each is a [`Check`]: what was measured, what a closed form expects, and how far apart they may be.

use rapier3d_f64::math::{Pose, Vector};
use rapier3d_f64::prelude::*;
use serde::{Deserialize, Serialize};

use super::engine::{Engine, GRAVITY_M_S2, from_rotation};
use super::{Conditions, JointForm, Level, Rollout, SimulationError, SimulationSettings, simulate};
use crate::humanoid::Humanoid;
use crate::motion::{Body, Frame, JOINTS, Motion, joint_index};

/// One experiment with a known answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// What was tried.
    pub name: String,
    /// What came out, in `unit`.
    pub measured: f64,
    /// What a closed form says, in `unit`.
    pub expected: f64,
    /// Largest accepted distance between the two, in `unit`.
    pub tolerance: f64,
    /// Unit of the three numbers.
    pub unit: String,
    /// The experiment in one line.
    pub how: String,
}

impl Check {
    /// Whether the measured value lies within the tolerance; a value that is not a number does not.
    #[must_use]
    pub fn passed(&self) -> bool {
        (self.measured - self.expected).abs() <= self.tolerance
    }
}

impl std::fmt::Display for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, measured, expected, tolerance, unit, .. } = self;
        write!(f, "{name}: measured {measured:.4} {unit}, expected {expected:.4} within {tolerance:.4}")
    }
}

fn check(name: &str, [measured, expected, tolerance]: [f64; 3], unit: &str, how: &str) -> Check {
    let [name, unit, how] = [name, unit, how].map(str::to_owned);
    Check { name, measured, expected, tolerance, unit, how }
}

/// Runs every check with the step, the iterations and the joint form of these settings.
///
/// Friction, assist and what is done to motions play no part.
///
/// # Errors
/// [`SimulationError`] when the settings cannot be simulated at all.
pub fn self_test(settings: &SimulationSettings) -> Result<Vec<Check>, SimulationError> {
    let settings = SimulationSettings {
        dt_secs: settings.dt_secs,
        pgs_iterations: settings.pgs_iterations,
        joint_form: settings.joint_form,
        feed_forward: false,
        swing_lift: false,
        sole_levelling: false,
        ground_correction_limit_m: 0.0,
        ..SimulationSettings::default()
    };
    settings.check()?;
    let (period, energy) = pendulum(&settings);
    Ok(vec![
        ground_is_there(&settings),
        drop_to_rest(&settings)?,
        ballistic_arc(&settings)?,
        period,
        energy,
        joint_limit_holds(&settings)?,
    ])
}

const BODY_HEIGHT_M: f64 = 1.75;

/// A motion of the standard body at 100 Hz from a function of time; it starts from neutral stance on the floor.
fn rollout(
    settings: &SimulationSettings,
    duration_secs: f64,
    pose: impl Fn(f64, &mut Frame),
) -> Result<(Humanoid, Rollout), SimulationError> {
    const RATE_HZ: f64 = 100.0;
    let body = Body::with_default_mass(BODY_HEIGHT_M);
    // The standard body is inside every bound that a humanoid asks for.
    let humanoid =
        Humanoid::new(body).map_err(|error| SimulationError::Body { reason: error.to_string() })?;
    let frames = (0..=(duration_secs * RATE_HZ).round() as usize)
        .map(|index| {
            let mut frame = Frame::ZERO;
            frame.root_position_m[2] = humanoid.standing_root_height_m();
            pose(index as f64 / RATE_HZ, &mut frame);
            frame
        })
        .collect();
    let motion = Motion::new(body, RATE_HZ, frames)?;
    let rollout = simulate(&humanoid, &motion, Level::L3, settings, &mut |_| {})?;
    Ok((humanoid, rollout))
}

fn drop_to_rest(settings: &SimulationSettings) -> Result<Check, SimulationError> {
    const DURATION_SECS: f64 = 2.0;
    const MEAN_OVER_SECS: f64 = 0.5;
    let (humanoid, rollout) = rollout(settings, DURATION_SECS, |_, frame| frame.root_position_m[2] += 0.02)?;
    let last = rollout.samples.iter().filter(|sample| sample.time_secs > DURATION_SECS - MEAN_OVER_SECS);
    let forces: Vec<f64> = last.map(|sample| sample.ground_force_n().z).collect();
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    let weight = humanoid.body.mass_kg * GRAVITY_M_S2;
    Ok(check(
        "weight at rest",
        [mean, weight, 0.01 * weight],
        "N",
        "the body dropped from 20 mm; ground force after 1.5 s, m g",
    ))
}

fn ballistic_arc(settings: &SimulationSettings) -> Result<Check, SimulationError> {
    const DURATION_SECS: f64 = 0.5;
    const UP_M_S: f64 = 2.0;
    let (humanoid, rollout) =
        rollout(settings, DURATION_SECS, |t, frame| frame.root_position_m[2] += 1.0 + UP_M_S * t)?;
    let height = |index: usize| {
        let poses = &rollout.samples[index].world_from_segment;
        let weighted = humanoid.segment_links.iter().zip(poses).filter_map(|(&link, pose)| {
            let inertial = humanoid.robot.tree.links()[link].inertial?;
            Some((inertial.mass_kg, (pose * nalgebra::Point3::from(inertial.com_in_link_m)).z))
        });
        let (mass, moment) = weighted.fold((0.0, 0.0), |(mass, sum), (m, z)| (mass + m, sum + m * z));
        moment / mass
    };
    let last = rollout.samples.len() - 1;
    let t = rollout.samples[last].time_secs;
    let expected = UP_M_S * t - 0.5 * GRAVITY_M_S2 * t * t;
    // The engine's symplectic Euler step is first order: the arc lies lower by g t dt / 2.
    let tolerance = 0.5 * GRAVITY_M_S2 * t * settings.dt_secs + 5e-4;
    Ok(check(
        "ballistic arc",
        [height(last) - height(0), expected, tolerance],
        "m",
        "the body thrown up at 2 m/s; rise of its centre of mass after 0.5 s, v t - g t^2 / 2",
    ))
}

fn joint_limit_holds(settings: &SimulationSettings) -> Result<Check, SimulationError> {
    const BEYOND_RAD: f64 = 0.5;
    // A joint of KIT's own list; a missing one would show as a body that cannot be built.
    let elbow = joint_index("LEx").unwrap_or_default();
    let limit = JOINTS[elbow].upper_rad;
    let (_, rollout) = rollout(settings, 1.0, |t, frame| {
        frame.joint_angles_rad[elbow] = (limit + BEYOND_RAD) * (2.0 * t).min(1.0);
    })?;
    let largest =
        rollout.samples.iter().map(|sample| sample.joint_angles_rad[elbow]).fold(f64::MIN, f64::max);
    Ok(check(
        "joint-limit hold",
        [largest, limit, 0.1],
        "rad",
        "an elbow told to bend 0.5 rad beyond its limit in 0.5 s; largest angle, the limit",
    ))
}

/// Corners and middle of a square on which motions take place, metres.
const PLACES_M: [[f64; 2]; 5] = [[0.0, 0.0], [50.0, 50.0], [50.0, -50.0], [-50.0, 50.0], [-50.0, -50.0]];

fn ground_is_there(settings: &SimulationSettings) -> Check {
    const RADIUS_M: f64 = 0.1;
    let mut engine = Engine::new(settings, &Conditions::undisturbed(settings));
    let balls = PLACES_M.map(|[x, y]| {
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(x, y, RADIUS_M + 0.05))
            .can_sleep(false)
            .additional_mass_properties(MassProperties::from_ball(1000.0, RADIUS_M));
        let handle = engine.bodies.insert(body);
        engine.attach(SharedShape::ball(RADIUS_M), Pose::IDENTITY, handle);
        handle
    });
    for _ in 0..(1.5 / settings.dt_secs).ceil() as usize {
        engine.step();
    }
    let off = balls.map(|ball| engine.bodies[ball].position().translation.z - RADIUS_M);
    let worst = off.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(f64::NAN);
    check(
        "ground",
        [worst * 1e3, 0.0, 1.0],
        "mm",
        "balls dropped in the middle and 70 m away from it; worst height of their lowest point at rest",
    )
}

/// Period and energy of a compound pendulum on a hinge of the joint form.
fn pendulum(settings: &SimulationSettings) -> (Check, Check) {
    const MASS_KG: f64 = 4.0;
    const ARM_M: f64 = 0.3;
    const INERTIA_KGM2: f64 = 0.05;
    const AMPLITUDE_RAD: f64 = 0.3;
    const NUM_PERIODS: usize = 5;

    let mut engine = Engine::new(settings, &Conditions::undisturbed(settings));
    let anchor = engine.bodies.insert(RigidBodyBuilder::fixed().translation(Vector::new(0.0, 0.0, 2.0)));
    let start = Rotation::from_axis_angle(Vector::X, AMPLITUDE_RAD);
    let bob = MassProperties::new(
        Vector::new(0.0, 0.0, -ARM_M),
        MASS_KG,
        Vector::new(INERTIA_KGM2, INERTIA_KGM2, INERTIA_KGM2),
    );
    let bob = engine.bodies.insert(
        RigidBodyBuilder::dynamic()
            .pose(Pose::from_parts(Vector::new(0.0, 0.0, 2.0), start))
            .can_sleep(false)
            .additional_mass_properties(bob),
    );
    let hinge = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
        .softness(super::balls::JOINT_SOFTNESS)
        .build();
    match settings.joint_form {
        JointForm::Balls => {
            engine.joints.insert(anchor, bob, hinge, true);
        }
        JointForm::Multibody => {
            if let Some(handle) = engine.multibodies.insert(anchor, bob, hinge, true)
                && let Some((multibody, _)) = engine.multibodies.get_mut(handle)
            {
                multibody.damping_mut().fill(0.0);
                multibody.armature_mut().fill(0.0);
                let mut turn = vec![0.0; multibody.ndofs()];
                if let Some(last) = turn.last_mut() {
                    *last = AMPLITUDE_RAD;
                }
                multibody.apply_displacements(&turn);
                multibody.forward_kinematics(&engine.bodies, false);
                multibody.update_rigid_bodies(&mut engine.bodies, true);
            }
        }
    }

    let about_hinge = INERTIA_KGM2 + MASS_KG * ARM_M * ARM_M;
    let (a2, a4) = (AMPLITUDE_RAD.powi(2), AMPLITUDE_RAD.powi(4));
    let expected = std::f64::consts::TAU
        * (about_hinge / (MASS_KG * GRAVITY_M_S2 * ARM_M)).sqrt()
        * (1.0 + a2 / 16.0 + 11.0 * a4 / 3072.0);

    let angle = |engine: &Engine| from_rotation(engine.bodies[bob].position().rotation).scaled_axis().x;
    // Energy between two steps, so that height and speed belong to one instant: the engine's step leaves them half a step
    // apart.
    let energy = |before: f64, after: f64| {
        let (middle, speed) = ((before + after) / 2.0, (after - before) / settings.dt_secs);
        MASS_KG * GRAVITY_M_S2 * ARM_M * (1.0 - middle.cos()) + 0.5 * about_hinge * speed * speed
    };
    let mut crossings = Vec::new();
    let mut energies = Vec::new();
    let mut before = angle(&engine);
    for step in 0..((NUM_PERIODS as f64 + 0.6) * expected / settings.dt_secs).ceil() as usize {
        engine.step();
        let after = angle(&engine);
        if before > 0.0 && after <= 0.0 {
            crossings.push((step as f64 + before / (before - after)) * settings.dt_secs);
        }
        energies.push(energy(before, after));
        before = after;
    }
    let period = match crossings.as_slice() {
        [first, .., last] => (last - first) / (crossings.len() - 1) as f64,
        _ => f64::NAN,
    };
    let (first, last) = (energies.first(), energies.last());
    let drift = first.zip(last).map_or(f64::NAN, |(first, last)| 100.0 * (last / first - 1.0));
    let period = check(
        "pendulum period",
        [period, expected, 0.005 * expected],
        "s",
        "five swings of 0.3 rad on a hinge; 2 pi sqrt(I / (m g l)) with its amplitude series",
    );
    let energy = check(
        "energy drift",
        [drift, 0.0, 5.0],
        "%",
        "energy of the same pendulum after its swings, none lost",
    );
    (period, energy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_check_passes_in_both_joint_forms() {
        for joint_form in [JointForm::Balls, JointForm::Multibody] {
            let settings = SimulationSettings { joint_form, ..SimulationSettings::default() };
            let checks = self_test(&settings).unwrap();
            assert_eq!(checks.len(), 6);
            for check in &checks {
                assert!(check.passed(), "{joint_form:?}: {check}");
            }
        }
    }

    #[test]
    fn a_wrong_engine_is_noticed() {
        // A step far too long for the springs: at least one closed form is missed.
        let settings =
            SimulationSettings { dt_secs: 0.02, pgs_iterations: 1, ..SimulationSettings::default() };
        let failed: Vec<String> = self_test(&settings)
            .unwrap()
            .iter()
            .filter(|check| !check.passed())
            .map(Check::to_string)
            .collect();
        assert!(!failed.is_empty());
    }

    #[test]
    fn a_number_that_is_none_fails() {
        assert!(!check("", [f64::NAN, 0.0, 1.0], "", "").passed());
        assert!(check("", [1.0, 0.0, 1.0], "", "").passed());
    }
}
