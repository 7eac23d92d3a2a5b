//! The physics engine's sets and pipeline in one place, and conversions to and from its vector types.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::math::{Pose, Rotation, Vector};
use rapier3d_f64::prelude::*;

use super::{Conditions, SimulationSettings};

/// Gravitational acceleration, m/s^2, along -z of the world. The one place where up and g are set.
pub const GRAVITY_M_S2: f64 = 9.81;

/// Version of the physics engine; numbers of different versions cannot be compared.
pub const ENGINE_VERSION: &str = rapier3d_f64::VERSION;

/// Collision group of the ground.
const GROUND: Group = Group::GROUP_1;
/// Collision group of the body; it meets the ground only, not itself.
const BODY: Group = Group::GROUP_2;

/// A world with flat ground at z = 0.
pub(super) struct Engine {
    parameters: IntegrationParameters,
    islands: IslandManager,
    broad_phase: DefaultBroadPhase,
    pub narrow_phase: NarrowPhase,
    pub bodies: RigidBodySet,
    pub colliders: ColliderSet,
    pub joints: ImpulseJointSet,
    pub multibodies: MultibodyJointSet,
    soft_bodies: SoftBodySet,
    ccd: CCDSolver,
    pipeline: PhysicsPipeline,
    pub ground: ColliderHandle,
    friction: f64,
    /// Factor on mass and inertia of every body.
    pub mass_factor: f64,
}

impl Engine {
    pub fn new(settings: &SimulationSettings, conditions: &Conditions) -> Self {
        let friction = settings.friction * conditions.friction_factor;
        let parameters = IntegrationParameters {
            dt: settings.dt_secs,
            num_solver_iterations: 1,
            num_internal_pgs_iterations: settings.pgs_iterations,
            num_internal_stabilization_iterations: 1,
            friction_model: FrictionModel::Coulomb,
            // Otherwise one pass a step alone holds the feet, and pushed bodies slip.
            friction_in_bias_pass: true,
            // Stiffer and less damped than the default, under which feet sink two millimetres.
            static_contact_softness: SpringCoefficients::new(120.0, 2.0),
            // Nothing passes through a metre of ground in one step.
            max_ccd_substeps: 0,
            ..IntegrationParameters::default()
        };
        let mut colliders = ColliderSet::new();
        let ground = ColliderBuilder::cuboid(500.0, 500.0, 0.5)
            .position(Pose::from_translation(Vector::new(0.0, 0.0, -0.5)))
            .friction(friction)
            .collision_groups(InteractionGroups::new(GROUND, BODY, InteractionTestMode::And));
        let ground = colliders.insert(ground);
        Self {
            parameters,
            islands: IslandManager::new(),
            broad_phase: DefaultBroadPhase::new(),
            narrow_phase: NarrowPhase::new(),
            bodies: RigidBodySet::new(),
            colliders,
            joints: ImpulseJointSet::new(),
            multibodies: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            ccd: CCDSolver::new(),
            pipeline: PhysicsPipeline::new(),
            ground,
            friction,
            mass_factor: conditions.mass_factor,
        }
    }

    /// Adds a shape of the body, massless, since bodies carry their own mass.
    pub fn attach(
        &mut self,
        shape: SharedShape,
        body_from_shape: Pose,
        body: RigidBodyHandle,
    ) -> ColliderHandle {
        let collider = ColliderBuilder::new(shape)
            .position(body_from_shape)
            .density(0.0)
            .friction(self.friction)
            .collision_groups(InteractionGroups::new(BODY, GROUND, InteractionTestMode::And));
        self.colliders.insert_with_parent(collider, body, &mut self.bodies)
    }

    pub fn step(&mut self) {
        self.pipeline.step(
            Vector::new(0.0, 0.0, -GRAVITY_M_S2),
            &self.parameters,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.joints,
            &mut self.multibodies,
            &mut self.soft_bodies,
            &mut self.ccd,
            &(),
            &(),
        );
    }

    pub fn dt_secs(&self) -> f64 {
        self.parameters.dt
    }

    /// Whether the engine took a body out of the simulation in the last step because its state was not finite.
    pub fn quarantined(&self) -> bool {
        !self.pipeline.quarantine().is_empty()
    }
}

pub(super) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

pub(super) fn rotation(r: &UnitQuaternion<f64>) -> Rotation {
    Rotation::from_xyzw(r.i, r.j, r.k, r.w)
}

pub(super) fn pose(p: &Isometry3<f64>) -> Pose {
    Pose::from_parts(vector(&p.translation.vector), rotation(&p.rotation))
}

pub(super) fn from_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

pub(super) fn from_rotation(r: Rotation) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(r.w, r.x, r.y, r.z))
}

pub(super) fn from_pose(p: &Pose) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(from_vector(p.translation)), from_rotation(p.rotation))
}
