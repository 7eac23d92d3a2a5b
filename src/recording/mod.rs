//! A rollout as a file that viewers open: one MCAP per rollout, in the ROS 2 profile.
//!
//! In: a [`RecordingHeader`], then [`crate::simulation::RolloutSample`]s as they happen, then a [`RecordingSummary`].
//! Out: an MCAP file, and [`view_commands`] to look at it.
//! Nothing here changes a score; a recording that fails is an error for the caller to report, not the end of a run.
//!
//! | topic | type | content |
//! |---|---|---|
//! | `/robot_description` | `std_msgs/String` | URDF with its visual shapes |
//! | `/tf`, `/tf_static` | `tf2_msgs/TFMessage` | every URDF link; [`BASE_FRAME`], [`ROOT_ALIGNED_FRAME`] |
//! | `/joint_states` | `sensor_msgs/JointState` | angles (rad), speeds (rad/s), mean torques (N m), KIT order |
//! | `/reference/...` | the same | the commanded pose as a second robot, frames under [`REFERENCE_PREFIX`] |
//! | `/contact_points` | `sensor_msgs/PointCloud2` | ground contacts in the world, m, with `force`, N |
//! | `/contact_wrench` | `geometry_msgs/WrenchStamped` | ground force (N) and its moment about the root (N m) |
//! | `/assist_wrench` | `geometry_msgs/WrenchStamped` | assist force (N) and moment (N m) at the root |
//! | `/metrics` | `rprae_msgs/SampleMetrics` | [`SAMPLE_METRICS`] |
//! | `/caption` | `std_msgs/String` | captions, one a line |
//! | `/rosout` | `rcl_interfaces/Log` | retargets, falls, failures, how it ended |
//!
//! Attachments: `robot.urdf` (whole), `settings.toml`, `result.json`.
//! Metadata records: `rollout` (id, level, captions), `run` (versions, seeds, signature), `outcome`, `scores`.

mod cdr;
mod description;
mod frames;
mod messages;
mod metrics;
mod recorder;
#[cfg(feature = "rerun")]
mod rerun;
mod rollout;
mod schemas;
mod topics;
mod view;

#[cfg(feature = "rerun")]
pub use self::rerun::{RerunTarget, rerun_view};
pub use frames::{BASE_FRAME, REFERENCE_PREFIX, ROOT_ALIGNED_FRAME, WORLD_FRAME};
pub use metrics::{SAMPLE_METRICS, SampleMetric};
pub use recorder::{Recorder, RecordingHeader, RecordingSummary};
pub use rollout::Recording;
pub use view::{ViewCommand, view_commands};

use std::path::PathBuf;

/// Time of the first sample of every recording, nanoseconds since the Unix epoch: 2020-01-01 00:00 UTC.
///
/// A fixed time, so that the same rollout gives the same file.
pub const START_TIME_NS: u64 = 1_577_836_800_000_000_000;

/// Why a recording could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// There is a file already.
    #[error("create the recording {}: it exists; remove it or choose another folder", path.display())]
    Exists {
        /// The recording.
        path: PathBuf,
    },
    /// The file could not be created.
    #[error("create the recording {}: {source}", path.display())]
    Create {
        /// The recording.
        path: PathBuf,
        /// What the file system said.
        source: std::io::Error,
    },
    /// The file could not be written on; it ends before this.
    #[error("write the recording {} at {time_secs:.3} s: {}", path.display(), reason(source))]
    Write {
        /// The recording.
        path: PathBuf,
        /// Time of the motion, seconds.
        time_secs: f64,
        /// What went wrong.
        source: mcap::McapError,
    },
    /// A file or folder could not be read.
    #[error("read {}: {source}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the file system said.
        source: std::io::Error,
    },
    /// The file is no MCAP file.
    #[error("read {}: it is not an MCAP recording", path.display())]
    NotARecording {
        /// The file.
        path: PathBuf,
    },
    /// The folder holds no recording.
    #[error("find recordings below {}: there is no .mcap file", path.display())]
    NoRecordings {
        /// The folder.
        path: PathBuf,
    },
    /// The recording was never closed.
    #[cfg(feature = "rerun")]
    #[error("open the recording {}: it was never closed; recover it with: {command}", path.display())]
    Unfinished {
        /// The recording.
        path: PathBuf,
        /// What recovers and shows it.
        command: String,
    },
    /// The viewer could not be started or written for.
    #[cfg(feature = "rerun")]
    #[error("show the recording {} in rerun: {reason}", path.display())]
    Rerun {
        /// The recording.
        path: PathBuf,
        /// What rerun said.
        reason: String,
    },
}

/// The cause in words: that of the file system where it is one.
fn reason(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}
