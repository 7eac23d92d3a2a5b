//! Simulation-in-the-loop evaluation of language <-> whole-body motion models.
//!
//! A motion of 50 channels, recorded or generated, drives a humanoid in a physics engine; what happens is scored for
//! physical plausibility, recorded, and compared with what was accepted before.
//!
//! ```text
//!  mocap --> retarget         features --> model --> training --> bundle
//!               |                 ^                                  |
//!               v                 |                             translation <--> captions
//!  files ----> dataset -----------+                                  |
//!                 |                                                  |
//!                 +-------> motion <---------------------------------+ (read back after physics, too)
//!                             |
//!                             +-----> humanoid (URDF, for a height and mass)
//!                             |             |
//!                             |   +---------+-----------------+
//!                             |   |                           |
//!                         dynamics (L1)                simulation (L2, L3)
//!                             |                               |  rollout
//!                             +--------> plausibility <-------+--------> recording (MCAP)
//!                                             |
//!                          harness: every case of a suite, safe on disk at once <--- evaluation (meaning)
//!                                             |
//!                                   report: tables, regressions
//! ```
//!
//! # Conventions
//!
//! - The world is right-handed with z up. Body frames are those of the MMM model: x right, y forward, z up.
//! - Metres, radians, seconds, kilograms and newtons everywhere inside; millimetres exist in files and printed scores only.
//! - `a_from_b` is the pose of frame b in frame a. A bare number carries its unit in its name: `duration_secs`.
//! - Equal input and settings give equal bits, with any number of threads. All randomness comes from one seed.
//! - A module imports modules of lower rank only; the order below is one of rising rank.
//!
//! # Modules, in reading order
//!
//! [`motion`] is the sequence of frames everything is about, and [`dataset`] reads it from files; what is in other skeletons
//! comes through [`mocap`] and [`retarget`].
//! [`kinematics`], [`robot`] and [`humanoid`] are the body.
//! [`dynamics`] finds the forces a motion takes, [`synthesis`] makes the motions of the bundled suite, and [`simulation`]
//! lets the body move.
//! [`plausibility`] turns motions and rollouts into scores, [`recording`] and [`report`] into files.
//! [`lint`] checks motions without moving them, and [`features`] prepares them for learning.
//! [`canaries`] proves that the scores see faults.
//! [`model`] and [`training`] make a bundle, and [`translation`] takes it from sentences to motions and back.
//! [`evaluation`] scores sentences against reference sentences, and motions made from captions.
//! [`experiments`] trains and scores the models of the paper's tables.
//! [`harness`] runs whole suites, [`manifest`] says what was run, and [`cli`] is what the programs are made of.
//!
//! # Example
//!
//! A body that stands 50 mm above the floor floats by 50 mm:
//!
//! ```
//! use rprae::humanoid::Humanoid;
//! use rprae::motion::{Body, Frame, Motion};
//! use rprae::plausibility::kinematic_scores;
//!
//! let humanoid = Humanoid::new(Body::with_default_mass(1.75))?;
//! let mut frame = Frame::ZERO;
//! frame.root_position_m[2] = humanoid.standing_root_height_m() + 0.050;
//! let motion = Motion::new(humanoid.body, 100.0, vec![frame; 200])?;
//!
//! let scores = kinematic_scores(&humanoid, &motion);
//! let float = scores.iter().find(|score| score.metric.key == "l0/float").ok_or("no such score")?;
//! assert_eq!(float.metric.unit, "mm");
//! assert!((float.value - 50.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod canaries;
pub mod cli;
pub mod dataset;
pub mod dynamics;
pub mod evaluation;
pub mod experiments;
pub mod features;
pub mod harness;
pub mod humanoid;
pub mod kinematics;
pub mod lint;
pub mod manifest;
pub mod mocap;
pub mod model;
pub mod motion;
pub mod plausibility;
pub mod recording;
pub mod report;
pub mod retarget;
pub mod robot;
pub mod simulation;
pub mod synthesis;
pub mod training;
pub mod translation;
