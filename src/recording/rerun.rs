//! A recording in the rerun viewer, laid out for a rollout.
//!
//! The layout: both robots and the contacts in 3D, caption and events below, and beside them tracking error, forces,
//! joint angles and joint torques over time.

use std::path::PathBuf;

use rerun::blueprint::components::{LoopMode, PanelState, PlayState, VisualizerComponentMapping};
use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ComponentSourceKind, ContainerLike, Horizontal,
    SelectionPanel, Spatial3DView, Tabs, TextDocumentView, TextLogView, TimePanel, TimeSeriesView, Vertical,
    Visualizer, VisualizerComponentMapping as Mapping,
};
use rerun::components::FillMode;
use rerun::{Boxes3D, Cylinders3D, Ellipsoids3D, RecordingStreamBuilder, SeriesLines};

use super::RecordingError;
use super::schemas::Schema;
use super::view::ViewCommand;

/// Where a recording is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RerunTarget {
    /// A viewer started from the `rerun` program on the search path.
    Viewer,
    /// An `.rrd` file for later, layout included.
    File(PathBuf),
}

/// Shows a recording in rerun, or saves it for rerun, with a layout for rollouts.
///
/// # Errors
/// [`RecordingError::Unfinished`] for the recording of a killed process, [`RecordingError::Exists`] when the file to
/// save to is there already, [`RecordingError::Rerun`] when rerun cannot be started or the file cannot be written.
pub fn rerun_view(rollout: &ViewCommand, target: &RerunTarget) -> Result<(), RecordingError> {
    let path = &rollout.recording;
    if !rollout.complete {
        return Err(RecordingError::Unfinished { path: path.clone(), command: rollout.command.clone() });
    }
    let failed = |error: &dyn std::fmt::Display| RecordingError::Rerun {
        path: path.clone(),
        reason: error.to_string(),
    };
    let builder = RecordingStreamBuilder::new("rprae")
        .recording_id(format!("{}-{}", rollout.id, rollout.level))
        .recording_name(format!("{} {}", rollout.id, rollout.level));
    let stream = match target {
        RerunTarget::Viewer => builder.spawn(),
        RerunTarget::File(path) if path.exists() => {
            return Err(RecordingError::Exists { path: path.clone() });
        }
        RerunTarget::File(path) => builder.save(path),
    }
    .map_err(|error| failed(&error))?;
    stream.log_file_from_path(path, None, true).map_err(|error| failed(&error))?;
    // Waits for the importer, too.
    stream.flush_blocking().map_err(|error| failed(&error))?;
    // The layout comes last: a view places its camera by what is there when the view appears.
    layout().send(&stream, BlueprintActivation::default()).map_err(|error| failed(&error))?;
    stream.flush_blocking().map_err(|error| failed(&error))
}

fn layout() -> Blueprint {
    // Solid bodies; the reference stays see-through by its colour.
    let scene = Spatial3DView::new("simulation and reference")
        .with_contents(["+ /**"])
        .with_defaults(&Boxes3D::update_fields().with_fill_mode(FillMode::Solid))
        .with_defaults(&Cylinders3D::update_fields().with_fill_mode(FillMode::Solid))
        .with_defaults(&Ellipsoids3D::update_fields().with_fill_mode(FillMode::Solid));
    let caption = TextDocumentView::new("caption").with_origin("/caption");
    let events = TextLogView::new("events").with_contents(["/rosout"]);
    let joints = |name: &str, origin: &str| TimeSeriesView::new(name).with_origin(origin);

    let left = Vertical::new([scene.into(), caption.into(), events.into()]).with_row_shares([6.0, 1.0, 2.0]);
    let angles = Tabs::new([
        joints("joint angles, rad", "/joint_states/position").into(),
        joints("commanded angles, rad", "/reference/joint_states/position").into(),
        joints("joint speeds, rad/s", "/joint_states/velocity").into(),
    ]);
    let right = Vertical::new([
        metrics_view("tracking error, mm", &["mpjpe_world_mm", "mpjpe_root_relative_mm"]),
        metrics_view(
            "forces in body weights, torque by its limit",
            &["ground_force_body_weights", "assist_force_body_weights", "torque_share_max"],
        ),
        ContainerLike::from(angles),
        joints("joint torques, N m", "/joint_states/effort").into(),
    ]);
    Blueprint::new(Horizontal::new([left.into(), right.into()]).with_column_shares([3.0, 2.0]))
        .with_auto_views(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(
            TimePanel::new()
                .with_state(PanelState::Collapsed)
                .with_timeline("message_log_time")
                .with_play_state(PlayState::Playing)
                .with_loop_mode(LoopMode::All),
        )
}

/// A plot of some fields of `/metrics`, one line each.
fn metrics_view(name: &str, fields: &[&str]) -> ContainerLike {
    let source = format!("{}:message", Schema::Metrics.name().replace('/', "."));
    let lines = fields.iter().map(|field| {
        let mapping = Mapping {
            target: "Scalars:scalars".into(),
            source_kind: ComponentSourceKind::SourceComponent,
            source_component: Some(source.as_str().into()),
            selector: Some(format!(".{field}").into()),
        };
        Visualizer::from(&SeriesLines::new().with_names([*field]))
            .with_mappings([VisualizerComponentMapping(mapping)])
    });
    TimeSeriesView::new(name).with_contents(["/metrics"]).with_overrides("/metrics", lines).into()
}
