//! The topics of a recording: names, types, how a player offers them.

use super::schemas::Schema;

/// A topic of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Topic {
    RobotDescription,
    ReferenceDescription,
    Caption,
    TfStatic,
    Tf,
    ReferenceTf,
    JointStates,
    ReferenceJointStates,
    ContactPoints,
    ContactWrench,
    AssistWrench,
    Metrics,
    Rosout,
}

/// Name, type, and whether the topic's one message is kept for those who subscribe later ("transient local").
pub(super) const TOPICS: [(Topic, &str, Schema, bool); 13] = [
    (Topic::RobotDescription, "/robot_description", Schema::Text, true),
    (Topic::ReferenceDescription, "/reference/robot_description", Schema::Text, true),
    (Topic::Caption, "/caption", Schema::Text, true),
    (Topic::TfStatic, "/tf_static", Schema::Transforms, true),
    (Topic::Tf, "/tf", Schema::Transforms, false),
    (Topic::ReferenceTf, "/reference/tf", Schema::Transforms, false),
    (Topic::JointStates, "/joint_states", Schema::JointState, false),
    (Topic::ReferenceJointStates, "/reference/joint_states", Schema::JointState, false),
    (Topic::ContactPoints, "/contact_points", Schema::PointCloud, false),
    (Topic::ContactWrench, "/contact_wrench", Schema::Wrench, false),
    (Topic::AssistWrench, "/assist_wrench", Schema::Wrench, false),
    (Topic::Metrics, "/metrics", Schema::Metrics, false),
    (Topic::Rosout, "/rosout", Schema::Log, false),
];

/// Quality of service of a topic in the form `ros2 bag` reads from MCAP files, with the policy names of ROS 2 Iron and newer.
pub(super) fn offered_qos(latched: bool) -> String {
    let durability = if latched { "transient_local" } else { "volatile" };
    let depth = if latched { 1 } else { 10 };
    let forever = "\n    sec: 9223372036\n    nsec: 854775807";
    format!(
        "- history: keep_last\n  depth: {depth}\n  reliability: reliable\n  durability: {durability}\n  \
         deadline:{forever}\n  lifespan:{forever}\n  liveliness: automatic\n  \
         liveliness_lease_duration:{forever}\n  avoid_ros_namespace_conventions: false"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_listed_in_the_order_of_their_numbers() {
        for (index, (topic, ..)) in TOPICS.iter().enumerate() {
            assert_eq!(*topic as usize, index, "{topic:?}");
        }
    }
}
