//! Rigid-body dynamics of a tree: what forces a movement takes.
//!
//! In: a tree, and its positions, speeds and accelerations ([`Trajectory`] makes them from a motion).
//! Out: joint torques and the wrench at the root ([`inverse_dynamics`]), the contact forces that explain most of it
//! ([`ContactSolver`]), and both over a whole motion ([`explain`]); mass matrix, centroidal momentum and Jacobians
//! ([`Inertia`], [`point_jacobian_into`]).
//! All arithmetic is `f64` in world coordinates; nothing here reads files or knows a physics engine.

mod contact_forces;
mod explained;
mod filter;
mod mass_matrix;
mod rnea;
mod trajectory;

pub use contact_forces::{ContactForces, ContactSolver};
pub use explained::{ExplainedFrame, Explainer, ExplanationSettings, RootWrench, explain};
pub use filter::low_pass;
pub use mass_matrix::{Inertia, point_jacobian_into};
pub use rnea::{ExternalForce, InverseDynamics, RootMotion, inverse_dynamics};
pub use trajectory::{Trajectory, TrajectoryFrame};
