//! The curves of a motion as a picture.

use crate::motion::{Motion, NUM_JOINTS, joint_index};
use crate::report::{Chart, Panel, Point, Series};

/// Most points of a curve.
const MAX_POINTS: usize = 200;

/// Joints that tell most of a movement, by limb.
const LIMBS: [(&str, [&str; 4]); 3] = [
    ("legs, bend [deg]", ["LHx", "RHx", "LKx", "RKx"]),
    ("arms, bend [deg]", ["LSx", "RSx", "LEx", "REx"]),
    ("arms, sideways [deg]", ["LSy", "RSy", "LSz", "RSz"]),
];

/// Path and heading of the root, and the joints of legs and arms, over time, as SVG.
pub(super) fn svg(motion: &Motion, title: &str) -> String {
    let stride = motion.num_frames().div_ceil(MAX_POINTS);
    let curve = |name: &str, value: &dyn Fn(&[f64]) -> f64| Series {
        name: name.to_owned(),
        points: motion
            .frames()
            .iter()
            .enumerate()
            .step_by(stride)
            .map(|(index, frame)| Point {
                x: index as f64 / motion.rate_hz(),
                y: value(&frame.to_channels()),
                interval: None,
            })
            .collect(),
    };
    let place = |name: &str, axis: usize| curve(name, &move |channels| channels[NUM_JOINTS + axis]);
    let turn =
        |name: &str, axis: usize| curve(name, &move |channels| channels[NUM_JOINTS + 3 + axis].to_degrees());
    let mut panels = vec![
        Panel {
            label: "root [m]".to_owned(),
            series: vec![place("to the right", 0), place("forward", 1), place("up", 2)],
        },
        Panel {
            label: "root [deg]".to_owned(),
            series: vec![turn("roll", 0), turn("pitch", 1), turn("yaw", 2)],
        },
    ];
    for (label, joints) in LIMBS {
        let series = joints
            .into_iter()
            .filter_map(|name| {
                let joint = joint_index(name)?;
                Some(curve(name, &move |channels| channels[joint].to_degrees()))
            })
            .collect();
        panels.push(Panel { label: label.to_owned(), series });
    }
    Chart { title: title.to_owned(), x_label: "time [s]".to_owned(), panels }.svg()
}
