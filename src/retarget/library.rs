//! Correspondences that come with the program, and which of them fits a clip.

use super::Correspondence;
use crate::mocap::Clip;

const FILES: [&str; 6] = [
    include_str!("../../assets/skeletons/cmu-mb.toml"),
    include_str!("../../assets/skeletons/cmu-daz.toml"),
    include_str!("../../assets/skeletons/acclaim.toml"),
    include_str!("../../assets/skeletons/bandai-namco.toml"),
    include_str!("../../assets/skeletons/humanml3d.toml"),
    include_str!("../../assets/skeletons/kit-ml.toml"),
];

/// The correspondences that come with the program.
pub fn bundled() -> impl Iterator<Item = Correspondence> {
    // A test reads every file, so none is left out here.
    FILES.iter().filter_map(|text| Correspondence::parse(text.as_bytes()).ok())
}

/// A skeleton that no correspondence fits.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "no known skeleton has these joints; nearest is {nearest}, for which {count} are missing: {}; \
     give a correspondence file with --skeleton",
    .missing.join(", ")
)]
pub struct UnknownSkeleton {
    /// Name of the correspondence with the smallest share of missing joints.
    pub nearest: String,
    /// How many joints it lacks.
    pub count: usize,
    /// The first few of them.
    pub missing: Vec<String>,
}

/// The bundled correspondence all of whose joints the clip has.
///
/// # Errors
/// [`UnknownSkeleton`] names the nearest and what is missing for it.
pub fn recognise(clip: &Clip) -> Result<Correspondence, UnknownSkeleton> {
    let mut nearest: Option<(f64, UnknownSkeleton)> = None;
    for correspondence in bundled() {
        let missing = correspondence.missing_in(clip);
        if missing.is_empty() {
            return Ok(correspondence);
        }
        let share = missing.len() as f64 / correspondence.joint_names().count() as f64;
        if nearest.as_ref().is_none_or(|(least, _)| share < *least) {
            let shown = missing.iter().take(8).map(|name| (*name).to_owned()).collect();
            let count = missing.len();
            nearest = Some((share, UnknownSkeleton { nearest: correspondence.name, count, missing: shown }));
        }
    }
    Err(nearest.map_or_else(
        || UnknownSkeleton { nearest: String::new(), count: 0, missing: Vec::new() },
        |(_, unknown)| unknown,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bundled_file_is_sound() {
        for text in FILES {
            if let Err(error) = Correspondence::parse(text.as_bytes()) {
                panic!("{error}\n{}", text.lines().next().unwrap_or_default());
            }
        }
    }
}
