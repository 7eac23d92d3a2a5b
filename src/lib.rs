//! Simulation-in-the-loop evaluation of language <-> whole-body motion models.

pub mod cli;
pub mod dataset;
pub mod dynamics;
pub mod harness;
pub mod humanoid;
pub mod kinematics;
pub mod manifest;
pub mod motion;
pub mod plausibility;
pub mod recording;
pub mod report;
pub mod robot;
pub mod simulation;
pub mod synthesis;
