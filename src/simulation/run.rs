//! The step loop.

use nalgebra::{Isometry3, Vector3};
use rapier3d_f64::prelude::RigidBody;

use super::articulation::Articulation;
use super::assist::{Assist, Wrench};
use super::balls::Balls;
use super::chain::{Chain, chains};
use super::contact::ContactSum;
use super::engine::{Engine, vector};
use super::fall::FallRule;
use super::feed_forward::{FeedForward, SegmentMoments};
use super::multibody::Multibody;
use super::reference::{Reference, ReferenceState};
use super::retarget::retarget;
use super::{
    Conditions, Event, EventKind, JointForm, Level, Outcome, Push, Rollout, RolloutSample, SegmentPoses,
    SimulationError, SimulationSettings,
};
use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::motion::{Motion, NUM_JOINTS};

/// Height below which the pelvis has left the world, metres: every number may be finite, and still the body fell through.
const LOST_BELOW_M: f64 = -0.5;
/// Speed no part of a body reaches, m/s.
const LOST_SPEED_M_S: f64 = 100.0;

/// A motion made ready for physics; its levels run from the same preparation.
pub struct Simulation<'a> {
    humanoid: &'a Humanoid,
    settings: &'a SimulationSettings,
    duration_secs: f64,
    /// What errors are measured against.
    reference_motion: Motion,
    reference: Reference,
    /// What the springs are told.
    command: Reference,
    chains: Vec<Chain>,
    feed_forward: Option<FeedForward>,
    /// What was changed in the preparation.
    events: Vec<Event>,
}

impl<'a> Simulation<'a> {
    /// Retargets the motion and finds the moments it takes.
    ///
    /// # Errors
    /// [`SimulationError`] when the settings or the body cannot be simulated.
    pub fn new(
        humanoid: &'a Humanoid,
        motion: &Motion,
        settings: &'a SimulationSettings,
    ) -> Result<Self, SimulationError> {
        settings.check()?;
        let retargeted = retarget(humanoid, motion, settings)?;
        Ok(Self {
            humanoid,
            settings,
            duration_secs: motion.duration_secs(),
            reference: Reference::new(&retargeted.reference),
            reference_motion: retargeted.reference,
            command: Reference::new(&retargeted.command),
            chains: chains(humanoid).map_err(|link| SimulationError::Chain { link })?,
            feed_forward: settings
                .feed_forward
                .then(|| FeedForward::new(humanoid, &retargeted.command, settings.friction)),
            events: retargeted.events,
        })
    }

    /// The motion that errors are measured against: without jumps, inside the joint limits, moved onto the floor.
    #[must_use]
    pub fn reference_motion(&self) -> &Motion {
        &self.reference_motion
    }

    /// What was changed in the preparation.
    #[must_use]
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Conditions in which nothing goes wrong.
    #[must_use]
    pub fn undisturbed(&self) -> Conditions {
        Conditions::undisturbed(self.settings)
    }

    /// What the body is told at a time.
    #[must_use]
    pub fn command(&self, time_secs: f64) -> Command {
        let Target { state, moments } = self.target_at(time_secs);
        let mut torques_nm = [0.0; NUM_JOINTS];
        for chain in &self.chains {
            chain.project(&state.angles, &moments[chain.segment], &mut torques_nm);
        }
        Command {
            angles_rad: state.angles,
            speeds_rad_s: state.speeds,
            torques_nm,
            world_from_root: state.world_from_root,
            root_velocity_m_s: state.root_velocity,
            root_angular_velocity_rad_s: state.root_angular_velocity,
        }
    }

    /// Pose of every segment that errors are measured against at a time.
    #[must_use]
    pub fn reference_poses(&self, time_secs: f64) -> SegmentPoses {
        reference_poses(self.humanoid, &self.reference.at(time_secs))
    }

    fn target_at(&self, time_secs: f64) -> Target {
        let known = self.feed_forward.as_ref();
        Target {
            state: self.command.at(time_secs),
            moments: known.map_or([Vector3::zeros(); NUM_SEGMENTS], |known| known.at(time_secs)),
        }
    }

    /// Runs one level; `observer` sees every sample as it is made.
    ///
    /// Level 2 has the bounded assist at the root, level 3 does not.
    /// A state that stops being one ends the rollout as [`Outcome::Failed`] with its time; that is a result, not an error.
    ///
    /// # Errors
    /// [`SimulationError`] when the level is not simulated or the engine refuses the body.
    pub fn run(
        &self,
        level: Level,
        observer: &mut dyn FnMut(&RolloutSample),
    ) -> Result<Rollout, SimulationError> {
        self.run_under(level, &self.undisturbed(), &mut Samples(observer))
    }

    /// As [`Simulation::run`], under conditions of one's own.
    ///
    /// # Errors
    /// [`SimulationError`] when the level is not simulated or the engine refuses the body.
    pub fn run_under(
        &self,
        level: Level,
        conditions: &Conditions,
        observer: &mut dyn Observer,
    ) -> Result<Rollout, SimulationError> {
        if !matches!(level, Level::L2 | Level::L3) {
            return Err(SimulationError::Level { level });
        }
        let Self { humanoid, settings, .. } = *self;
        let mut engine = Engine::new(settings, conditions);
        let mut start = self.command.at(0.0);
        if let Some(offsets) = &conditions.start_offsets_rad {
            for (angle, offset) in start.angles.iter_mut().zip(offsets) {
                *angle += offset;
            }
        }
        let mut body: Box<dyn Articulation> = match settings.joint_form {
            JointForm::Balls => Box::new(Balls::new(&mut engine, humanoid, self.chains.clone(), &start)),
            JointForm::Multibody => Box::new(
                Multibody::new(&mut engine, humanoid, &self.chains, &start)
                    .ok_or(SimulationError::Multibody)?,
            ),
        };
        let root = body.segments()[0];
        let assist = (level == Level::L2 && conditions.assist_limit > 0.0).then(|| {
            let mass_kg = humanoid.body.mass_kg;
            Assist::new(&mut engine, root, mass_kg, conditions.assist_limit, settings.assist_arm_m)
        });

        let steps_per_sample = settings.steps_per_sample();
        let num_steps = (self.duration_secs / settings.dt_secs).ceil() as usize;
        let mut rollout = Rollout {
            level,
            settings: SimulationSettings { assist_limit: conditions.assist_limit, ..settings.clone() },
            sample_interval_secs: steps_per_sample as f64 * settings.dt_secs,
            motion_duration_secs: self.duration_secs,
            samples: Vec::with_capacity(num_steps / steps_per_sample + 1),
            events: self.events.clone(),
            outcome: Outcome::Completed,
            max_joint_drift_m: 0.0,
        };
        let mut run =
            Run { humanoid, reference: &self.reference, assist: assist.as_ref(), sums: Sums::default() };
        rollout.events.iter().for_each(|event| observer.event(event));
        let start = run.sample(&engine, &mut *body, 0.0, 1);
        observer.sample(&start);
        rollout.samples.push(start);
        let fall_rule = FallRule::new(humanoid);
        let mut fallen = false;
        for step in 0..num_steps {
            let time_secs = step as f64 * settings.dt_secs;
            let command = self.target_at((time_secs - conditions.latency_secs).max(0.0));
            body.command(&mut engine, &command.state, &command.moments);
            if let Some(assist) = &assist {
                let now = (conditions.latency_secs > 0.0).then(|| self.command.at(time_secs));
                assist.command(&mut engine, now.as_ref().unwrap_or(&command.state));
            }
            if let Some(push) = &conditions.push {
                apply(push, time_secs, &mut engine.bodies[root]);
            }
            engine.step();
            if let Some(reason) = fault(&engine, &*body) {
                let time_secs = time_secs + settings.dt_secs;
                let event = Event { time_secs, kind: EventKind::Failure, message: reason.clone() };
                observer.event(&event);
                rollout.events.push(event);
                rollout.outcome = Outcome::Failed { time_secs, reason };
                break;
            }
            run.add_step(&engine, &mut *body);
            if (step + 1) % steps_per_sample == 0 {
                let sample =
                    run.sample(&engine, &mut *body, (step + 1) as f64 * settings.dt_secs, steps_per_sample);
                rollout.max_joint_drift_m = rollout.max_joint_drift_m.max(body.joint_drift_m(&engine));
                if !fallen && let Some(cause) = fall_rule.fall(&sample) {
                    fallen = true;
                    let message = fall_rule.message(cause, &sample);
                    let event = Event { time_secs: sample.time_secs, kind: EventKind::Fall, message };
                    observer.event(&event);
                    rollout.events.push(event);
                }
                observer.sample(&sample);
                rollout.samples.push(sample);
            }
        }
        Ok(rollout)
    }
}

/// What the body is told at one time.
struct Target {
    state: ReferenceState,
    moments: SegmentMoments,
}

/// What the body is told at one time, joint by joint, for programs that simulate the same with another engine.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Rest angles of the joint springs, KIT order, radians.
    pub angles_rad: [f64; NUM_JOINTS],
    /// Speeds their dampers act against, KIT order, rad/s.
    pub speeds_rad_s: [f64; NUM_JOINTS],
    /// Feed-forward torques, KIT order, N m.
    pub torques_nm: [f64; NUM_JOINTS],
    /// Pose of the root that the assist pulls to.
    pub world_from_root: Isometry3<f64>,
    /// Velocity of the root origin in the world, m/s.
    pub root_velocity_m_s: Vector3<f64>,
    /// Angular velocity of the root in the world, rad/s.
    pub root_angular_velocity_rad_s: Vector3<f64>,
}

/// Sees a rollout as it happens.
pub trait Observer {
    /// A sample, in time order.
    fn sample(&mut self, sample: &RolloutSample);
    /// An event, before the sample that ends its interval.
    fn event(&mut self, event: &Event);
}

/// Looks away.
impl Observer for () {
    fn sample(&mut self, _sample: &RolloutSample) {}

    fn event(&mut self, _event: &Event) {}
}

/// An observer of samples alone.
struct Samples<'a>(&'a mut dyn FnMut(&RolloutSample));

impl Observer for Samples<'_> {
    fn sample(&mut self, sample: &RolloutSample) {
        (self.0)(sample);
    }

    fn event(&mut self, _event: &Event) {}
}

/// Sets the force of a push on a body for the step that starts now.
fn apply(push: &Push, time_secs: f64, body: &mut RigidBody) {
    body.reset_forces(true);
    if (push.time_secs..push.time_secs + push.duration_secs).contains(&time_secs) {
        body.add_force(vector(&push.force_n), true);
    }
}

/// Forces summed over the steps of a sample.
#[derive(Default)]
struct Sums {
    contacts: ContactSum,
    wrench: Wrench,
}

/// What a sample is read from.
struct Run<'a> {
    humanoid: &'a Humanoid,
    reference: &'a Reference,
    assist: Option<&'a Assist>,
    sums: Sums,
}

impl Run<'_> {
    fn add_step(&mut self, engine: &Engine, body: &mut dyn Articulation) {
        let segments = body.segments();
        self.sums.contacts.add_step(engine, |handle| segments.iter().position(|&segment| segment == handle));
        if let Some(assist) = self.assist {
            let wrench = assist.wrench(engine);
            self.sums.wrench.force_n += wrench.force_n;
            self.sums.wrench.moment_nm += wrench.moment_nm;
        }
        body.add_step(engine);
    }

    fn sample(
        &mut self,
        engine: &Engine,
        body: &mut dyn Articulation,
        time_secs: f64,
        num_steps: usize,
    ) -> RolloutSample {
        let Sums { mut contacts, wrench } = std::mem::take(&mut self.sums);
        let share = 1.0 / num_steps as f64;
        let target = self.reference.at(time_secs);
        let (joint_angles_rad, joint_velocities_rad_s) = body.angles_and_speeds(engine);
        RolloutSample {
            time_secs,
            world_from_segment: body.segment_poses(engine),
            reference_world_from_segment: reference_poses(self.humanoid, &target),
            joint_angles_rad,
            joint_velocities_rad_s,
            joint_torques_nm: body.take_torques(&joint_angles_rad),
            reference_joint_angles_rad: target.angles,
            assist_force_n: wrench.force_n * share,
            assist_moment_nm: wrench.moment_nm * share,
            contacts: contacts.take(num_steps as f64 * engine.dt_secs()),
        }
    }
}

fn reference_poses(humanoid: &Humanoid, target: &ReferenceState) -> SegmentPoses {
    let links = humanoid.robot.tree.forward(&target.world_from_root, &humanoid.tree_angles(&target.angles));
    humanoid.segment_links.map(|link| links[link])
}

/// Why the state is no state any more, if so.
fn fault(engine: &Engine, body: &dyn Articulation) -> Option<String> {
    if engine.quarantined() {
        return Some("the engine quarantined a body whose state was not finite".to_owned());
    }
    for &handle in body.segments() {
        let segment = &engine.bodies[handle];
        let (position, velocity) = (segment.position().translation, segment.linvel());
        let numbers = [position.x, position.y, position.z, velocity.x, velocity.y, velocity.z];
        if numbers.iter().any(|number| !number.is_finite()) {
            return Some("a position or velocity is not a finite number".to_owned());
        }
        if Vector3::new(velocity.x, velocity.y, velocity.z).norm() > LOST_SPEED_M_S {
            return Some(format!("a segment moves faster than {LOST_SPEED_M_S} m/s"));
        }
    }
    let height = engine.bodies[body.segments()[0]].position().translation.z;
    (height < LOST_BELOW_M).then(|| format!("the pelvis is {:.2} m below the floor", -height))
}
