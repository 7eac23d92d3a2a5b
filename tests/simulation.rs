//! The simulation against closed forms, against itself, and against its own bounds.

#![expect(clippy::unwrap_used, reason = "a test that cannot unwrap has failed")]

use nalgebra::Vector3;
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, Motion, joint_index};
use rprae::simulation::{
    Conditions, EventKind, GRAVITY_M_S2, JointForm, Level, Outcome, Push, Rollout, RolloutSample, Simulation,
    SimulationError, SimulationSettings, simulate,
};

const RATE_HZ: f64 = 100.0;

fn adult() -> Humanoid {
    Humanoid::new(Body::with_default_mass(1.75)).unwrap()
}

/// A motion at 100 Hz from a function of time.
fn motion(duration_secs: f64, mut pose: impl FnMut(f64, &mut Frame)) -> Motion {
    let body = Body::with_default_mass(1.75);
    let frames = (0..=(duration_secs * RATE_HZ) as usize)
        .map(|index| {
            let mut frame = Frame::ZERO;
            frame.root_position_m[2] = 0.53 * body.height_m;
            pose(index as f64 / RATE_HZ, &mut frame);
            frame
        })
        .collect();
    Motion::new(body, RATE_HZ, frames).unwrap()
}

fn standing(duration_secs: f64) -> Motion {
    motion(duration_secs, |_, _| {})
}

fn run(motion: &Motion, level: Level, settings: &SimulationSettings) -> Rollout {
    simulate(&adult(), motion, level, settings, &mut |_| {}).unwrap()
}

fn center_of_mass(humanoid: &Humanoid, sample: &RolloutSample) -> Vector3<f64> {
    let mut weighted = Vector3::zeros();
    let mut mass = 0.0;
    for (segment, pose) in sample.world_from_segment.iter().enumerate() {
        let link = &humanoid.robot.tree.links()[humanoid.segment_links[segment]];
        let inertial = link.inertial.unwrap();
        weighted += (pose * nalgebra::Point3::from(inertial.com_in_link_m)).coords * inertial.mass_kg;
        mass += inertial.mass_kg;
    }
    weighted / mass
}

fn weight_n() -> f64 {
    Body::with_default_mass(1.75).mass_kg * GRAVITY_M_S2
}

#[test]
fn ground_and_assist_carry_the_weight_at_rest() {
    for joint_form in [JointForm::Balls, JointForm::Multibody] {
        let duration = if joint_form == JointForm::Balls { 3.0 } else { 1.5 };
        let settings = SimulationSettings { joint_form, ..SimulationSettings::default() };
        let rollout = run(&standing(duration), Level::L2, &settings);
        let at_rest: Vec<_> = rollout.samples.iter().filter(|s| s.time_secs > duration - 0.5).collect();
        let carried: f64 = at_rest.iter().map(|s| s.ground_force_n().z + s.assist_force_n.z).sum::<f64>()
            / at_rest.len() as f64;
        assert!((carried / weight_n() - 1.0).abs() < 0.01, "{joint_form:?}: {carried} of {} N", weight_n());
    }
}

#[test]
fn flight_follows_a_parabola() {
    // Thrown up and forward from well above the floor, turning nothing.
    let humanoid = adult();
    let (up, forward) = (2.0, 0.7);
    let thrown = motion(0.5, |t, frame| {
        frame.root_position_m[1] = forward * t;
        frame.root_position_m[2] += 1.0 + up * t;
    });
    let settings = SimulationSettings { ground_correction_limit_m: 0.0, ..SimulationSettings::default() };
    let rollout = run(&thrown, Level::L3, &settings);
    let start = center_of_mass(&humanoid, &rollout.samples[0]);
    for sample in &rollout.samples {
        assert!(sample.contacts.is_empty());
        let t = sample.time_secs;
        let expected = start + Vector3::new(0.0, forward * t, up * t - 0.5 * GRAVITY_M_S2 * t * t);
        let found = center_of_mass(&humanoid, sample);
        // Symplectic Euler is first order: half a step of g t.
        let bound = 0.5 * GRAVITY_M_S2 * t * settings.dt_secs + 1e-4;
        assert!((found - expected).norm() <= bound, "at {t}: {found} for {expected}");
    }
}

#[test]
fn momentum_changes_by_the_impulse_of_ground_assist_and_gravity() {
    // Standing that starts with 0.6 m/s sideways: friction, assist and weight all act.
    let humanoid = adult();
    let pushed = motion(0.8, |t, frame| {
        frame.root_position_m[0] = 0.6 * t;
        frame.root_position_m[1] = 0.3 * t;
    });
    let rollout = run(&pushed, Level::L2, &SimulationSettings::default());
    let mass = humanoid.body.mass_kg;
    let interval = rollout.sample_interval_secs;
    let com: Vec<_> = rollout.samples.iter().map(|sample| center_of_mass(&humanoid, sample)).collect();
    let gravity = Vector3::new(0.0, 0.0, -mass * GRAVITY_M_S2);
    // Twice the integral of force is position; compare displacement so that no speed needs to be differenced.
    let mut velocity = Vector3::new(0.6, 0.3, 0.0);
    let mut position = com[0];
    let mut largest_friction: f64 = 0.0;
    for (sample, found) in rollout.samples.iter().zip(&com).skip(1) {
        let force = sample.ground_force_n() + sample.assist_force_n + gravity;
        let previous = velocity;
        velocity += force / mass * interval;
        position += (previous + velocity) * 0.5 * interval;
        largest_friction = largest_friction.max(sample.ground_force_n().xy().norm());
        assert!((found - position).norm() < 4e-3, "at {}: {found} for {position}", sample.time_secs);
    }
    assert!(largest_friction > 50.0, "the test wants friction to act, {largest_friction} N");
}

#[test]
fn friction_stays_in_its_cone_and_the_assist_in_its_bounds() {
    let settings = SimulationSettings { friction: 0.5, ..SimulationSettings::default() };
    let wild = motion(1.5, |t, frame| {
        frame.root_position_m[0] = 0.25 * (9.0 * t).sin();
        frame.root_rotation_rad[2] = 0.6 * (7.0 * t).sin();
    });
    let rollout = run(&wild, Level::L2, &settings);
    let limit = settings.assist_limit * weight_n();
    let (mut pulled, mut turned, mut slipped): (f64, f64, f64) = (0.0, 0.0, 0.0);
    for sample in &rollout.samples {
        pulled = pulled.max(sample.assist_force_n.norm());
        turned = turned.max(sample.assist_moment_nm.norm());
        for contact in &sample.contacts {
            assert!(contact.force_n.z > 0.0, "the ground only pushes: {contact:?}");
            let ratio = contact.force_n.xy().norm() / contact.force_n.z;
            slipped = slipped.max(ratio);
            assert!(ratio <= settings.friction * 1.001, "{contact:?}");
        }
    }
    assert!(pulled <= limit * (1.0 + 1e-9) && pulled > 0.9 * limit, "{pulled} of {limit} N");
    assert!(
        turned <= limit * settings.assist_arm_m * (1.0 + 1e-9)
            && turned > 0.5 * limit * settings.assist_arm_m
    );
    assert!(slipped > 0.4, "the test wants the feet to slip, {slipped}");
}

#[test]
fn a_held_arm_takes_the_torque_of_its_weight() {
    let humanoid = adult();
    let (shoulder, elbow) = (joint_index("LSx").unwrap(), joint_index("LEx").unwrap());
    for joint_form in [JointForm::Balls, JointForm::Multibody] {
        let settings = SimulationSettings { joint_form, ..SimulationSettings::default() };
        let held = motion(2.0, |_, frame| frame.joint_angles_rad[shoulder] = std::f64::consts::FRAC_PI_2);
        let rollout = run(&held, Level::L2, &settings);
        let last = rollout.samples.last().unwrap();
        for (joint, first_link) in [(shoulder, "left_upper_arm"), (elbow, "left_forearm")] {
            let tree = &humanoid.robot.tree;
            let top = tree.link_index(first_link).unwrap();
            let pivot =
                last.world_from_segment[humanoid.segment_links.iter().position(|&l| l == top).unwrap()];
            // Moment of the weight of everything below the joint about its x axis through the pivot.
            let names = ["left_upper_arm", "left_forearm", "left_hand"];
            let below = names.iter().skip_while(|name| **name != first_link);
            let expected: f64 = below
                .map(|name| {
                    let link = tree.link_index(name).unwrap();
                    let segment = humanoid.segment_links.iter().position(|&l| l == link).unwrap();
                    let inertial = tree.links()[link].inertial.unwrap();
                    let com =
                        last.world_from_segment[segment] * nalgebra::Point3::from(inertial.com_in_link_m);
                    inertial.mass_kg * GRAVITY_M_S2 * (com.y - pivot.translation.y)
                })
                .sum();
            let found = last.joint_torques_nm[joint];
            assert!(
                expected > 1.0 && (found / expected - 1.0).abs() < 0.05,
                "{joint_form:?} {found} {expected}"
            );
        }
    }
}

#[test]
fn same_input_same_bits_on_any_thread() {
    let turning = motion(0.6, |t, frame| frame.root_rotation_rad[2] = 0.5 * t);
    let settings = SimulationSettings::default();
    let here = run(&turning, Level::L2, &settings);
    let elsewhere: Vec<Rollout> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..3).map(|_| scope.spawn(|| run(&turning, Level::L2, &settings))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(elsewhere.iter().all(|other| *other == here));
}

#[test]
fn both_joint_forms_agree_on_a_gesture() {
    let (shoulder, elbow) = (joint_index("RSx").unwrap(), joint_index("REx").unwrap());
    let gesture = motion(1.2, |t, frame| {
        let share = 0.5 - 0.5 * (std::f64::consts::PI * (t / 1.2)).cos();
        frame.joint_angles_rad[shoulder] = 1.2 * share;
        frame.joint_angles_rad[elbow] = 0.8 * share;
    });
    let [balls, reduced] = [JointForm::Balls, JointForm::Multibody].map(|joint_form| {
        run(&gesture, Level::L2, &SimulationSettings { joint_form, ..SimulationSettings::default() })
    });
    let mut squares = 0.0;
    for (a, b) in balls.samples.iter().zip(&reduced.samples) {
        squares +=
            a.joint_angles_rad.iter().zip(&b.joint_angles_rad).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
    }
    let rms = (squares / (balls.samples.len() * 44) as f64).sqrt();
    assert!(rms < 0.01, "joint angles of the two forms differ by {rms} rad rms");
    assert!(balls.max_joint_drift_m < 1e-3, "joints came apart by {} m", balls.max_joint_drift_m);
    assert_eq!(reduced.max_joint_drift_m, 0.0);
}

#[test]
fn a_state_that_is_none_ends_the_rollout_with_its_time() {
    let jump = motion(0.5, |t, frame| frame.root_position_m[1] = if t > 0.2 { 9000.0 } else { 0.0 });
    let settings = SimulationSettings { assist_limit: 100.0, ..SimulationSettings::default() };
    let rollout = run(&jump, Level::L2, &settings);
    let Outcome::Failed { time_secs, reason } = &rollout.outcome else { panic!("{:?}", rollout.outcome) };
    assert!((0.15..0.5).contains(time_secs), "{time_secs} {reason}");
    assert!(rollout.samples.iter().all(|sample| sample.time_secs <= *time_secs));
    assert!(rollout.events.iter().any(|event| event.message == *reason));

    let buried = motion(0.2, |_, frame| frame.root_position_m[2] = -3.0);
    let Outcome::Failed { reason, .. } = run(&buried, Level::L3, &SimulationSettings::default()).outcome
    else {
        panic!("a body under the floor must fail");
    };
    assert!(reason.contains("below the floor"), "{reason}");
}

#[test]
fn one_frame_is_a_rollout_of_one_sample() {
    let single = Motion::new(Body::with_default_mass(1.75), 10.0, vec![Frame::ZERO]).unwrap();
    let rollout = run(&single, Level::L2, &SimulationSettings::default());
    assert_eq!((rollout.samples.len(), rollout.outcome), (1, Outcome::Completed));
}

#[test]
fn refuses_levels_and_settings_it_cannot_run() {
    let (humanoid, motion) = (adult(), standing(0.1));
    let settings = SimulationSettings { dt_secs: 0.5, ..SimulationSettings::default() };
    let error = simulate(&humanoid, &motion, Level::L2, &settings, &mut |_| {}).unwrap_err();
    assert!(error.to_string().contains("dt_secs"), "{error}");
    let error =
        simulate(&humanoid, &motion, Level::L0, &SimulationSettings::default(), &mut |_| {}).unwrap_err();
    assert_eq!(error, SimulationError::Level { level: Level::L0 });
}

#[test]
fn swing_lift_changes_the_command_but_not_what_errors_are_measured_against() {
    // One foot stands, the other swings low and fast.
    let (hip, knee) = (joint_index("RHx").unwrap(), joint_index("RKx").unwrap());
    let low = motion(1.0, |t, frame| {
        let swing = (std::f64::consts::TAU * t).sin();
        frame.joint_angles_rad[hip] = 0.3 * swing;
        frame.joint_angles_rad[knee] = -0.15;
    });
    let [with, without] = [true, false].map(|swing_lift| {
        run(&low, Level::L2, &SimulationSettings { swing_lift, ..SimulationSettings::default() })
    });
    assert!(with.events.iter().any(|event| event.message.contains("swing feet lifted")));
    assert!(!without.events.iter().any(|event| event.message.contains("swing")));
    let mut lifted = 0.0_f64;
    for (a, b) in with.samples.iter().zip(&without.samples) {
        assert_eq!(a.reference_world_from_segment, b.reference_world_from_segment);
        lifted = lifted.max((a.joint_angles_rad[knee] - b.joint_angles_rad[knee]).abs());
    }
    assert!(lifted > 0.05, "the knee should bend more, by {lifted} rad");
}

#[test]
fn a_fall_is_an_event_with_its_time() {
    let lying = motion(1.5, |_, frame| {
        // Tilted far forward with nothing under the chest: without assist it falls.
        frame.root_rotation_rad[0] = -0.6;
    });
    let rollout = run(&lying, Level::L3, &SimulationSettings::default());
    let falls: Vec<_> = rollout.events.iter().filter(|event| event.kind == EventKind::Fall).collect();
    assert_eq!(falls.len(), 1, "{:?}", rollout.events);
    assert!(falls[0].time_secs > 0.1 && falls[0].time_secs < 1.5);
    assert!(
        run(&standing(0.5), Level::L2, &SimulationSettings::default())
            .events
            .iter()
            .all(|event| event.kind != EventKind::Fall)
    );
}

#[test]
fn a_jump_of_the_recording_is_filtered_and_reported() {
    let toe = joint_index("LFx").unwrap();
    let jumping =
        motion(0.5, |t, frame| frame.joint_angles_rad[toe] = if (t - 0.25).abs() < 1e-6 { 1.0 } else { 0.0 });
    let rollout = run(&jumping, Level::L2, &SimulationSettings::default());
    assert!(
        rollout.events.iter().any(|e| e.message.contains("1.00 rad in LFx at 0.2")),
        "{:?}",
        rollout.events
    );
    let commanded = rollout.samples.iter().map(|s| s.reference_joint_angles_rad[toe]).fold(0.0, f64::max);
    assert!(commanded < 0.01, "{commanded}");
}

#[test]
fn unknown_mass_is_carried_and_a_push_is_felt() {
    let (humanoid, motion) = (adult(), standing(1.5));
    let settings = SimulationSettings::default();
    let simulation = Simulation::new(&humanoid, &motion, &settings).unwrap();
    let heavy = Conditions { mass_factor: 1.1, ..simulation.undisturbed() };
    let rollout = simulation.run_under(Level::L2, &heavy, &mut ()).unwrap();
    let last: Vec<_> = rollout.samples.iter().filter(|sample| sample.time_secs > 1.0).collect();
    let carried =
        last.iter().map(|s| s.ground_force_n().z + s.assist_force_n.z).sum::<f64>() / last.len() as f64;
    assert!((carried / (1.1 * weight_n()) - 1.0).abs() < 0.01, "{carried}");

    // In flight nothing else acts sideways: the impulse is the change of momentum.
    let thrown = motion_in_flight();
    let settings = SimulationSettings { ground_correction_limit_m: 0.0, ..settings };
    let simulation = Simulation::new(&humanoid, &thrown, &settings).unwrap();
    let push = Push { time_secs: 0.1, duration_secs: 0.1, force_n: Vector3::new(200.0, 0.0, 0.0) };
    let pushed = Conditions { push: Some(push), ..simulation.undisturbed() };
    let rollout = simulation.run_under(Level::L3, &pushed, &mut ()).unwrap();
    let x = |index: usize| center_of_mass(&humanoid, &rollout.samples[index]).x;
    let end = rollout.samples.len() - 1;
    let speed = (x(end) - x(end - 12)) / (12.0 * rollout.sample_interval_secs);
    let expected = 20.0 / humanoid.body.mass_kg;
    assert!((speed / expected - 1.0).abs() < 0.02, "{speed} for {expected} m/s");
}

fn motion_in_flight() -> Motion {
    motion(0.4, |t, frame| frame.root_position_m[2] += 1.0 + t)
}
