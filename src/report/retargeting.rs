//! How well a set of retargeted clips follows its sources: one row a clip, and the distribution over all.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::number::counted;
use crate::dataset::Skipped;
use crate::retarget::{Quality, Retargeted};

/// A clip and its quality.
#[derive(Debug, Clone)]
pub struct ClipRow {
    /// Id of the clip.
    pub id: String,
    /// Name of the correspondence.
    pub skeleton: String,
    /// Number of frames.
    pub num_frames: usize,
    /// Rate, hertz.
    pub rate_hz: f64,
    /// Body height, metres.
    pub height_m: f64,
    /// How well it follows.
    pub quality: Quality,
    /// What was assumed or changed.
    pub notes: Vec<String>,
}

impl ClipRow {
    /// The row of a retargeted clip.
    #[must_use]
    pub fn new(id: String, retargeted: Retargeted) -> Self {
        let Retargeted { motion, quality, skeleton, notes } = retargeted;
        Self {
            id,
            skeleton,
            num_frames: motion.num_frames(),
            rate_hz: motion.rate_hz(),
            height_m: motion.body().height_m,
            quality,
            notes,
        }
    }

    fn to_json(&self) -> Value {
        let quality = &self.quality;
        let millimetres = |metres: f64| 1e3 * metres;
        json!({
            "id": self.id,
            "skeleton": self.skeleton,
            "frames": self.num_frames,
            "rate_hz": self.rate_hz,
            "height_m": self.height_m,
            "median_residual_mm": millimetres(quality.raw_median_m),
            "median_residual_at_our_proportions_mm": millimetres(quality.pose_median_m),
            "joints": quality.joints.iter().map(|joint| json!({
                "joint": joint.role.name(),
                "residual_mm": millimetres(joint.raw_m),
                "residual_at_our_proportions_mm": millimetres(joint.pose_m),
                "proportion_mm": millimetres(joint.proportion_m),
            })).collect::<Vec<_>>(),
            "bones": quality.bones.iter().map(|bone| json!({
                "bone": bone.bone,
                "median_deg": bone.median_rad.to_degrees(),
                "sustained_deg": bone.sustained_rad.to_degrees(),
            })).collect::<Vec<_>>(),
            "angles_at_limit_share": quality.at_limit,
            "beyond_limit_rad": quality.beyond_limit_rad,
            "flipped": quality.flipped,
            "contact_agreement": quality.contact_agreement,
            "stance_sole_height_mm": quality.stance_height_m.map(|heights| heights.map(millimetres)),
            "stance_slip_mm_s": quality.stance_slip_m_s.map(millimetres),
            "source_stance_slip_mm_s": quality.source_slip_m_s.map(millimetres),
            "ground_shift_mm": millimetres(quality.ground_shift_m),
            "travel_ratio": quality.travel_ratio,
            "fastest_joint_rad_s": quality.fastest_rad_s.0,
            "fastest_joint": quality.fastest_rad_s.1,
            "notes": self.notes,
        })
    }
}

/// All clips of a run, and what could not be used.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Clips in the order of the inputs.
    pub clips: Vec<ClipRow>,
    /// What was skipped and why.
    pub skipped: Vec<Skipped>,
}

impl Report {
    /// One object with all clips and all skipped inputs.
    #[must_use]
    pub fn to_json(&self) -> String {
        let skipped: Vec<Value> = self
            .skipped
            .iter()
            .map(|skipped| json!({"id": skipped.id, "source": skipped.source, "reason": skipped.reason}))
            .collect();
        let clips: Vec<Value> = self.clips.iter().map(ClipRow::to_json).collect();
        let mut text = format!("{:#}", json!({"clips": clips, "skipped": skipped}));
        text.push('\n');
        text
    }

    /// The distribution over clips, for each skeleton, as text for a person.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut skeletons: Vec<&str> = self.clips.iter().map(|clip| clip.skeleton.as_str()).collect();
        skeletons.sort_unstable();
        skeletons.dedup();
        let mut text = String::new();
        for skeleton in skeletons {
            let clips: Vec<&ClipRow> = self.clips.iter().filter(|clip| clip.skeleton == skeleton).collect();
            write_skeleton(&mut text, skeleton, &clips);
        }
        let _ = writeln!(
            text,
            "{} retargeted, {} skipped",
            counted(self.clips.len(), "clip"),
            counted(self.skipped.len(), "input")
        );
        for skipped in self.skipped.iter().take(20) {
            let _ = writeln!(text, "skipped {skipped}");
        }
        text
    }
}

fn write_skeleton(text: &mut String, skeleton: &str, clips: &[&ClipRow]) {
    let frames: usize = clips.iter().map(|clip| clip.num_frames).sum();
    let _ = writeln!(text, "{skeleton}: {}, {}", counted(clips.len(), "clip"), counted(frames, "frame"));
    let _ =
        writeln!(text, "  {:44} {:>8} {:>8} {:>8} {:>8}", "over clips", "least", "median", "95 %", "most");
    let mut line = |name: &str, value: &dyn Fn(&Quality) -> Option<f64>| {
        let mut values: Vec<f64> =
            clips.iter().filter_map(|clip| value(&clip.quality)).filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        if let [least, .., most] | [least @ most] = values.as_slice() {
            let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
            let _ = writeln!(text, "  {name:44} {least:8.2} {:8.2} {:8.2} {most:8.2}", at(0.5), at(0.95));
        }
    };
    line("median residual, mm", &|quality| Some(1e3 * quality.raw_median_m));
    line("median residual at our proportions, mm", &|quality| Some(1e3 * quality.pose_median_m));
    line("sole to floor in flat stance, median, mm", &|quality| Some(1e3 * quality.stance_height_m?[0]));
    line("sole to floor in flat stance, 95 %, mm", &|quality| Some(1e3 * quality.stance_height_m?[1]));
    line("moved vertically, mm", &|quality| Some(1e3 * quality.ground_shift_m));
    line("slip in flat stance, median, mm/s", &|quality| Some(1e3 * quality.stance_slip_m_s?));
    line("the same of the source's ankles, mm/s", &|quality| Some(1e3 * quality.source_slip_m_s?));
    line("stance agrees, % of frames", &|quality| Some(1e2 * quality.contact_agreement));
    line("travel over the source's", &|quality| quality.travel_ratio);
    line("angles at a limit, %", &|quality| Some(1e2 * quality.at_limit));
    line("fastest joint, rad/s", &|quality| Some(quality.fastest_rad_s.0));
    let flipped: Vec<&str> =
        clips.iter().filter(|clip| !clip.quality.flipped.is_empty()).map(|clip| clip.id.as_str()).collect();
    let beyond = clips.iter().filter(|clip| clip.quality.beyond_limit_rad > 1e-9).count();
    let _ = writeln!(
        text,
        "  clips with a joint beyond its limits: {beyond}; with a bone over 60 degrees off for over 0.2 s: {} {}",
        flipped.len(),
        flipped.iter().take(8).copied().collect::<Vec<_>>().join(" ")
    );
    let _ = writeln!(
        text,
        "  {:16} {:>10} {:>20} {:>14}   median over clips of the median over frames, mm",
        "joint", "residual", "at our proportions", "proportions"
    );
    let Some(first) = clips.first() else { return };
    for (index, joint) in first.quality.joints.iter().enumerate() {
        let median = |value: &dyn Fn(&Quality) -> f64| {
            let mut values: Vec<f64> = clips.iter().map(|clip| 1e3 * value(&clip.quality)).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let _ = writeln!(
            text,
            "  {:16} {:10.1} {:20.1} {:14.1}",
            joint.role.name(),
            median(&|quality| quality.joints[index].raw_m),
            median(&|quality| quality.joints[index].pose_m),
            median(&|quality| quality.joints[index].proportion_m)
        );
    }
}
