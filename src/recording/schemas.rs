//! Message definitions, as ROS 2 writes them into a recording: the type itself, then every type it uses.

use std::fmt::Write as _;

use super::metrics::SAMPLE_METRICS;

/// Line between two definitions of one schema.
const SEPARATOR: &str = "================================================================================\n";

const TIME: &str = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
const HEADER: &str = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
const VECTOR3: &str = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
const QUATERNION: &str = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";
const TRANSFORM: &str = "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\n\
                         geometry_msgs/Quaternion rotation\n";
const TRANSFORM_STAMPED: &str = "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\n\
                                 string child_frame_id\ngeometry_msgs/Transform transform\n";
const POINT_FIELD: &str = "MSG: sensor_msgs/PointField\nuint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\n\
                           uint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\n\
                           string name\nuint32 offset\nuint8 datatype\nuint32 count\n";
const WRENCH: &str = "MSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n";

/// A message type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Schema {
    Text,
    Transforms,
    JointState,
    PointCloud,
    Wrench,
    Log,
    Metrics,
}

impl Schema {
    /// Type name, `package/msg/Type`.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Text => "std_msgs/msg/String",
            Self::Transforms => "tf2_msgs/msg/TFMessage",
            Self::JointState => "sensor_msgs/msg/JointState",
            Self::PointCloud => "sensor_msgs/msg/PointCloud2",
            Self::Wrench => "geometry_msgs/msg/WrenchStamped",
            Self::Log => "rcl_interfaces/msg/Log",
            Self::Metrics => "rprae_msgs/msg/SampleMetrics",
        }
    }

    /// Definition text.
    pub(super) fn definition(self) -> String {
        let (own, uses): (String, &[&str]) = match self {
            Self::Text => ("string data\n".to_owned(), &[]),
            Self::Transforms => (
                "geometry_msgs/TransformStamped[] transforms\n".to_owned(),
                &[TRANSFORM_STAMPED, HEADER, TIME, TRANSFORM, VECTOR3, QUATERNION],
            ),
            Self::JointState => (
                "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
                 float64[] effort\n"
                    .to_owned(),
                &[HEADER, TIME],
            ),
            Self::PointCloud => (
                "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n\
                 bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"
                    .to_owned(),
                &[HEADER, TIME, POINT_FIELD],
            ),
            Self::Wrench => (
                "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n".to_owned(),
                &[HEADER, TIME, WRENCH, VECTOR3],
            ),
            Self::Log => (
                "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n\
                 builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n\
                 string function\nuint32 line\n"
                    .to_owned(),
                &[TIME],
            ),
            Self::Metrics => {
                let mut own = "std_msgs/Header header\n".to_owned();
                for metric in &SAMPLE_METRICS {
                    // Writing to a string cannot fail.
                    let _ = write!(own, "# {}\nfloat64 {}\n", metric.meaning, metric.name);
                }
                (own, &[HEADER, TIME])
            }
        };
        uses.iter().fold(own, |text, used| text + SEPARATOR + used)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Schema; 7] = [
        Schema::Text,
        Schema::Transforms,
        Schema::JointState,
        Schema::PointCloud,
        Schema::Wrench,
        Schema::Log,
        Schema::Metrics,
    ];

    #[test]
    fn every_type_used_is_defined_and_every_type_defined_is_used() {
        for schema in ALL {
            let text = schema.definition();
            let defined: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
            let used: Vec<&str> = text
                .lines()
                .filter(|line| !line.starts_with("MSG: ") && !line.starts_with('#'))
                .filter_map(|line| line.split([' ', '[']).next())
                .filter(|name| name.contains('/'))
                .collect();
            for name in &used {
                assert!(defined.contains(name), "{schema:?} uses {name}");
            }
            for name in &defined {
                assert!(used.contains(name), "{schema:?} defines {name} in vain");
            }
        }
    }
}
