//! The step loop.

use nalgebra::Vector3;

use super::articulation::Articulation;
use super::assist::{Assist, Wrench};
use super::balls::Balls;
use super::chain::{Chain, chains};
use super::contact::ContactSum;
use super::engine::Engine;
use super::fall::FallRule;
use super::feed_forward::FeedForward;
use super::multibody::Multibody;
use super::reference::{Reference, ReferenceState};
use super::retarget::retarget;
use super::{
    Event, EventKind, JointForm, Level, Outcome, Rollout, RolloutSample, SegmentPoses, SimulationError,
    SimulationSettings,
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
        if !matches!(level, Level::L2 | Level::L3) {
            return Err(SimulationError::Level { level });
        }
        let Self { humanoid, settings, .. } = *self;
        let mut engine = Engine::new(settings);
        let start = self.command.at(0.0);
        let mut body: Box<dyn Articulation> = match settings.joint_form {
            JointForm::Balls => Box::new(Balls::new(&mut engine, humanoid, self.chains.clone(), &start)),
            JointForm::Multibody => Box::new(
                Multibody::new(&mut engine, humanoid, &self.chains, &start)
                    .ok_or(SimulationError::Multibody)?,
            ),
        };
        let assist = (level == Level::L2 && settings.assist_limit > 0.0)
            .then(|| Assist::new(&mut engine, body.segments()[0], humanoid.body.mass_kg, settings));

        let steps_per_sample = settings.steps_per_sample();
        let num_steps = (self.duration_secs / settings.dt_secs).ceil() as usize;
        let mut rollout = Rollout {
            level,
            settings: settings.clone(),
            sample_interval_secs: steps_per_sample as f64 * settings.dt_secs,
            motion_duration_secs: self.duration_secs,
            samples: Vec::with_capacity(num_steps / steps_per_sample + 1),
            events: self.events.clone(),
            outcome: Outcome::Completed,
            max_joint_drift_m: 0.0,
        };
        let mut run =
            Run { humanoid, reference: &self.reference, assist: assist.as_ref(), sums: Sums::default() };
        let start = run.sample(&engine, &*body, 0.0, 1);
        observer(&start);
        rollout.samples.push(start);
        let fall_rule = FallRule::new(humanoid);
        let mut fallen = false;
        for step in 0..num_steps {
            let time_secs = step as f64 * settings.dt_secs;
            let target = self.command.at(time_secs);
            let moments = self
                .feed_forward
                .as_ref()
                .map_or([Vector3::zeros(); NUM_SEGMENTS], |known| known.at(time_secs));
            body.command(&mut engine, &target, &moments);
            if let Some(assist) = &assist {
                assist.command(&mut engine, &target);
            }
            engine.step();
            if let Some(reason) = fault(&engine, &*body) {
                let time_secs = time_secs + settings.dt_secs;
                rollout.events.push(Event { time_secs, kind: EventKind::Failure, message: reason.clone() });
                rollout.outcome = Outcome::Failed { time_secs, reason };
                break;
            }
            run.add_step(&engine, &*body);
            if (step + 1) % steps_per_sample == 0 {
                let sample =
                    run.sample(&engine, &*body, (step + 1) as f64 * settings.dt_secs, steps_per_sample);
                rollout.max_joint_drift_m = rollout.max_joint_drift_m.max(body.joint_drift_m(&engine));
                if !fallen && let Some(cause) = fall_rule.fall(&sample) {
                    fallen = true;
                    let message = fall_rule.message(cause, &sample);
                    rollout.events.push(Event {
                        time_secs: sample.time_secs,
                        kind: EventKind::Fall,
                        message,
                    });
                }
                observer(&sample);
                rollout.samples.push(sample);
            }
        }
        Ok(rollout)
    }
}

/// Forces summed over the steps of a sample.
#[derive(Default)]
struct Sums {
    contacts: ContactSum,
    wrench: Wrench,
    torques: Option<[f64; NUM_JOINTS]>,
}

/// What a sample is read from.
struct Run<'a> {
    humanoid: &'a Humanoid,
    reference: &'a Reference,
    assist: Option<&'a Assist>,
    sums: Sums,
}

impl Run<'_> {
    fn add_step(&mut self, engine: &Engine, body: &dyn Articulation) {
        let segments = body.segments();
        self.sums.contacts.add_step(engine, |handle| segments.iter().position(|&segment| segment == handle));
        if let Some(assist) = self.assist {
            let wrench = assist.wrench(engine);
            self.sums.wrench.force_n += wrench.force_n;
            self.sums.wrench.moment_nm += wrench.moment_nm;
        }
        let (angles, _) = body.angles_and_speeds(engine);
        body.add_torques(engine, &angles, self.sums.torques.get_or_insert([0.0; NUM_JOINTS]));
    }

    fn sample(
        &mut self,
        engine: &Engine,
        body: &dyn Articulation,
        time_secs: f64,
        num_steps: usize,
    ) -> RolloutSample {
        let Sums { mut contacts, wrench, torques } = std::mem::take(&mut self.sums);
        let share = 1.0 / num_steps as f64;
        let target = self.reference.at(time_secs);
        let (joint_angles_rad, joint_velocities_rad_s) = body.angles_and_speeds(engine);
        RolloutSample {
            time_secs,
            world_from_segment: body.segment_poses(engine),
            reference_world_from_segment: reference_poses(self.humanoid, &target),
            joint_angles_rad,
            joint_velocities_rad_s,
            joint_torques_nm: torques.unwrap_or([0.0; NUM_JOINTS]).map(|sum| sum * share),
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
