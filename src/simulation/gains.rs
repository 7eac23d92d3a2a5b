//! Stiffness and damping of the joint springs.

/// Spring and damper of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// Stiffness, N m/rad.
    pub stiffness_nm_rad: f64,
    /// Damping, N m s/rad.
    pub damping_nms_rad: f64,
}

/// Gains of the joint with this KIT short name.
///
/// They hold a 75 kg body in stance at the default step; all axes of one anatomical joint share a pair.
#[must_use]
pub fn gains(short_name: &str) -> Gains {
    let (stiffness_nm_rad, damping_nms_rad) = match short_name {
        name if name.starts_with("BP") || name.starts_with("BT") => (1000.0, 50.0),
        name if name.starts_with("BLN") || name.starts_with("BUN") => (80.0, 4.0),
        name => match &name[1..] {
            "Hx" | "Hy" | "Hz" | "Kx" => (1000.0, 50.0),
            "Ax" | "Ay" | "Az" => (1000.0, 40.0),
            "Fx" => (150.0, 3.0),
            "Mrot" => (50.0, 1.0),
            "Sx" | "Sy" | "Sz" => (200.0, 10.0),
            "Ex" | "Ez" => (150.0, 6.0),
            _ => (30.0, 1.0),
        },
    };
    Gains { stiffness_nm_rad, damping_nms_rad }
}
