//! Motion capture of other skeletons, retargeted on the way in.

use super::entry::Format;
use super::files::{FileError, MAX_MOTION_BYTES};
use super::table::{Content, TableError, read_table};
use super::{Dataset, Entry, Skipped};
use crate::mocap::{Clip, MocapError, PositionsError, read_amc, read_asf, read_bvh};
use crate::retarget::{
    Correspondence, Quality, RetargetError, RetargetOptions, Retargeted, recognise, retarget,
};

/// Why motion capture gives no motion.
#[derive(Debug, thiserror::Error)]
pub(super) enum CaptureError {
    #[error("the file {0}")]
    File(#[from] FileError),
    #[error(transparent)]
    Mocap(#[from] MocapError),
    #[error(
        "an .amc needs its skeleton: there is no .asf beside it whose name begins this one's \
         (02_01.amc goes with 02.asf)"
    )]
    NoSkeleton,
    #[error("the skeleton {name}: {source}")]
    Skeleton { name: String, source: Box<CaptureError> },
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(transparent)]
    Positions(#[from] PositionsError),
    #[error(transparent)]
    Retarget(#[from] RetargetError),
}

impl Dataset {
    /// The same motions, with all motion capture taken for this skeleton instead of recognised by its joint names.
    #[must_use]
    pub fn with_skeleton(self, skeleton: Correspondence) -> Self {
        Self { skeleton: Some(skeleton), ..self }
    }

    /// Reads and retargets one motion; `None` when it is one of the humanoid already.
    ///
    /// # Errors
    /// [`Skipped`] names the file and, in one line, the place in it and the reason.
    pub fn retarget(&self, entry: &Entry) -> Result<Option<Retargeted>, Skipped> {
        let read = || -> Result<Option<Retargeted>, CaptureError> {
            match entry.format {
                Format::Mmm | Format::Csv => Ok(None),
                Format::Bvh | Format::Amc => {
                    let bytes = self.files.read(&entry.name, MAX_MOTION_BYTES)?;
                    self.retarget_capture(entry, &bytes).map(Some)
                }
                Format::Npy | Format::Npz => {
                    let bytes = self.files.read(&entry.name, MAX_MOTION_BYTES)?;
                    let table = read_table(&bytes, entry.format)?;
                    let Content::Positions(order, centres) = table.content else { return Ok(None) };
                    let clip = order.clip(centres, table.rate_hz)?;
                    self.retarget_clip(entry, &clip, table.height_m).map(Some)
                }
            }
        };
        read().map_err(|error| entry.skipped(&error))
    }

    /// A BVH or AMC file.
    pub(super) fn retarget_capture(&self, entry: &Entry, bytes: &[u8]) -> Result<Retargeted, CaptureError> {
        let clip = match &entry.skeleton {
            _ if entry.format == Format::Bvh => read_bvh(bytes)?,
            None => return Err(CaptureError::NoSkeleton),
            Some(name) => {
                let skeleton = || -> Result<_, CaptureError> {
                    Ok(read_asf(&self.files.read(name, MAX_MOTION_BYTES)?)?)
                };
                let skeleton = skeleton().map_err(|source| CaptureError::Skeleton {
                    name: name.clone(),
                    source: Box::new(source),
                })?;
                read_amc(bytes, &skeleton)?
            }
        };
        self.retarget_clip(entry, &clip, None)
    }

    /// A rate that the file states holds; otherwise that of the manifest, then that set for tables.
    pub(super) fn retarget_clip(
        &self,
        entry: &Entry,
        clip: &Clip,
        height_m: Option<f64>,
    ) -> Result<Retargeted, CaptureError> {
        let recognised;
        let skeleton = if let Some(skeleton) = &self.skeleton {
            skeleton
        } else {
            recognised = recognise(clip).map_err(RetargetError::from)?;
            &recognised
        };
        let options = RetargetOptions {
            rate_hz: clip.rate_hz().or(entry.rate_hz).or(self.options.rate_hz),
            height_m: entry.height_m.or(height_m),
            mass_kg: self.options.mass_kg,
        };
        Ok(retarget(clip, skeleton, &options)?)
    }
}

/// What a person should know about a retargeted motion, one sentence first, then what was assumed.
pub(super) fn warnings(retargeted: &Retargeted) -> Vec<String> {
    let Quality { pose_median_m, raw_median_m, .. } = retargeted.quality;
    let mut warnings = vec![format!(
        "retargeted from the skeleton {} to a body of {:.2} m: the median joint is {:.0} mm from the source's, {:.0} mm \
         at our proportions; what positions leave open follows rules (see `rprae retarget --help`)",
        retargeted.skeleton,
        retargeted.motion.body().height_m,
        1e3 * raw_median_m,
        1e3 * pose_median_m
    )];
    warnings.extend(retargeted.notes.iter().cloned());
    warnings
}
