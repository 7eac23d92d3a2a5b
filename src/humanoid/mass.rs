//! Mass, centre of mass and inertia of the segments.

use nalgebra::{Matrix3, Vector3};

use super::foot::place;
use super::segments::{Block, FOOT_MASS_FRACTION, Mass, SEGMENTS, Segment};
use crate::kinematics::Inertial;
use crate::motion::Body;

/// Mass distribution of a segment of this body, in the frame of the segment.
pub(super) fn inertial(segment: &Segment, body: Body) -> Inertial {
    let parts: Vec<Inertial> = segment.masses.iter().map(|mass| part(segment, mass, body)).collect();
    let mass_kg: f64 = parts.iter().map(|part| part.mass_kg).sum();
    let com = parts.iter().map(|part| part.com_in_link_m * part.mass_kg).sum::<Vector3<f64>>() / mass_kg;
    let inertia = parts
        .iter()
        .map(|part| {
            // Parallel axis theorem.
            let lever = part.com_in_link_m - com;
            let shift = Matrix3::identity() * lever.norm_squared() - lever * lever.transpose();
            part.inertia_about_com_kgm2 + shift * part.mass_kg
        })
        .sum();
    Inertial { mass_kg, com_in_link_m: com, inertia_about_com_kgm2: inertia }
}

fn part(segment: &Segment, mass: &Mass, body: Body) -> Inertial {
    match *mass {
        Mass::Known { fraction, com_mm, inertia } => Inertial {
            mass_kg: fraction * body.mass_kg,
            com_in_link_m: Vector3::from(com_mm) * (body.height_m / 1000.0),
            inertia_about_com_kgm2: Matrix3::from_diagonal(&Vector3::from(inertia))
                * (body.mass_kg * body.height_m * body.height_m),
        },
        Mass::ShareOfFoot(block) => share_of_foot(segment, &block, body),
    }
}

/// A uniform block with the foot's mean density.
fn share_of_foot(segment: &Segment, block: &Block, body: Body) -> Inertial {
    let mass_kg = FOOT_MASS_FRACTION * body.mass_kg * block.volume_mm3() / foot_volume_mm3(segment);
    let placed = place(segment, block, body);
    let squares = placed.size_m.component_mul(&placed.size_m);
    let along_block = Vector3::new(squares.y + squares.z, squares.x + squares.z, squares.x + squares.y);
    let rotation = placed.segment_from_block.rotation.to_rotation_matrix();
    Inertial {
        mass_kg,
        com_in_link_m: placed.segment_from_block.translation.vector,
        inertia_about_com_kgm2: rotation
            * Matrix3::from_diagonal(&(along_block * (mass_kg / 12.0)))
            * rotation.inverse(),
    }
}

/// Volume of all blocks of the foot this segment belongs to.
fn foot_volume_mm3(segment: &Segment) -> f64 {
    let side = |name: &'static str| name.split('_').next();
    SEGMENTS
        .iter()
        .filter(|other| side(other.name) == side(segment.name))
        .flat_map(|other| other.masses)
        .filter_map(|mass| match mass {
            Mass::ShareOfFoot(block) => Some(block.volume_mm3()),
            Mass::Known { .. } => None,
        })
        .sum()
}
