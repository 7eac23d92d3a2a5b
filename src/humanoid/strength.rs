//! Effort and velocity limits of the joints, from published human strength.
//!
//! A URDF effort limit is symmetric and constant, so each joint gets the larger of its two directions.

/// Strength of a group of joints.
pub(super) struct Strength {
    /// Peak torque per kilogram of body mass, N m/kg.
    pub torque_nm_per_kg: f64,
    /// Peak joint speed, rad/s.
    pub velocity_rad_s: f64,
}

/// Strength of the joint with this KIT short name.
pub(super) fn strength(short_name: &str) -> Strength {
    let (torque_nm_per_kg, velocity_rad_s) = match short_name {
        "BPx" | "BPy" | "BPz" | "BTx" | "BTy" | "BTz" => (4.0, 10.0),
        "BLNx" | "BLNy" | "BLNz" | "BUNx" | "BUNy" | "BUNz" => (0.7, 15.0),
        name => match &name[1..] {
            "Hx" | "Hy" | "Hz" => (3.5, 20.0),
            "Kx" => (3.5, 25.0),
            "Ax" | "Ay" | "Az" => (3.0, 20.0),
            "Mrot" | "Fx" => (0.8, 20.0),
            "Sx" | "Sy" | "Sz" => (1.2, 30.0),
            "Ex" | "Ez" => (1.0, 35.0),
            _ => (0.25, 30.0),
        },
    };
    Strength { torque_nm_per_kg, velocity_rad_s }
}
