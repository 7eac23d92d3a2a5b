//! What points on the surface of the body show: they stand in for the vertices of a mesh.

use nalgebra::{Isometry3, Point3, Vector2, Vector3};

use super::trace::horizontal_m;
use crate::humanoid::{Humanoid, Solids};

/// Weight of a point below the floor grows by this per metre of depth.
const PRESSURE_PER_M: f64 = 100.0;
/// Weight of a point over the floor falls by this exponent per metre of height.
const DECAY_PER_M: f64 = 10.0;

/// One frame.
#[expect(clippy::struct_field_names, reason = "all are lengths in metres")]
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct SurfaceFrame {
    /// Mean depth of the points below the floor, zero without any, metres.
    pub mean_depth_m: f64,
    /// Mean horizontal step since the frame before of the foot's points that are at or below the floor in both, metres.
    pub slide_m: f64,
    /// Height-weighted mean of all points along x and y, metres: where the body presses on the floor.
    pub pressure_m: Vector2<f64>,
}

/// The points, and where those of the feet were in the frame before.
pub(super) struct Surface<'a> {
    points: &'a [(usize, Point3<f64>)],
    is_foot: Vec<bool>,
    before_m: Vec<Vector3<f64>>,
}

impl<'a> Surface<'a> {
    pub(super) fn new(humanoid: &Humanoid, solids: &'a Solids) -> Self {
        let points = solids.surface();
        let has_sole = |link: usize| humanoid.sole_points.iter().any(|point| point.link == link);
        let is_foot = points.iter().map(|(link, _)| has_sole(*link)).collect();
        Self { points, is_foot, before_m: Vec::new() }
    }

    /// Measures the next frame.
    pub(super) fn frame(&mut self, world_from_link: &[Isometry3<f64>]) -> SurfaceFrame {
        let now_m: Vec<Vector3<f64>> =
            self.points.iter().map(|(link, point)| (world_from_link[*link] * point).coords).collect();
        let mut depth = Mean::default();
        let mut slide = Mean::default();
        let (mut weighted, mut weights) = (Vector2::zeros(), 0.0);
        for (index, point) in now_m.iter().enumerate() {
            if point.z < 0.0 {
                depth.add(-point.z);
            }
            if self.is_foot[index]
                && point.z <= 0.0
                && let Some(before) = self.before_m.get(index).filter(|before| before.z <= 0.0)
            {
                slide.add(horizontal_m(&(point - before)));
            }
            let weight =
                if point.z < 0.0 { 1.0 - PRESSURE_PER_M * point.z } else { (-DECAY_PER_M * point.z).exp() };
            weighted += point.xy() * weight;
            weights += weight;
        }
        self.before_m = now_m;
        // A body that is far above the floor has weights too small to be told from zero.
        let pressure_m = if weights > 0.0 { weighted / weights } else { Vector2::zeros() };
        SurfaceFrame { mean_depth_m: depth.or_zero(), slide_m: slide.or_zero(), pressure_m }
    }
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn or_zero(&self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum / self.count as f64 }
    }
}
