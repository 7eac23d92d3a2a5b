//! The self-test of the physics engine, remembered for each build.
//!
//! In: settings, and a folder for what need not be computed twice.
//! Out: a [`Proof`]: the checks, and whether they were remembered.

use std::path::{Path, PathBuf};

use crate::manifest::{platform, processor, program_sha256, sha256_hex, write_file};
use crate::simulation::{Check, SimulationError, SimulationSettings, self_test};

/// Outcome of the self-test.
#[derive(Debug, Clone, PartialEq)]
pub struct Proof {
    /// Every check with its numbers.
    pub checks: Vec<Check>,
    /// Whether the numbers come from an earlier run of this build on this machine.
    pub remembered: bool,
}

impl Proof {
    /// Checks that failed.
    pub fn failed(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| !check.passed())
    }

    /// One line for a log.
    #[must_use]
    pub fn line(&self) -> String {
        let passed = self.checks.len() - self.failed().count();
        let when = if self.remembered { ", remembered from an earlier run of this build" } else { "" };
        format!("physics self-test: {passed} of {} checks passed{when}", self.checks.len())
    }
}

/// Runs the self-test, unless `cache` holds that this build passed it with these settings on this machine.
///
/// A cache that cannot be read or written costs time, nothing else.
///
/// # Errors
/// [`SimulationError`] when the settings cannot be simulated at all.
pub fn prove(settings: &SimulationSettings, cache: Option<&Path>) -> Result<Proof, SimulationError> {
    let file = cache.map(|folder| folder.join(file_name(settings)));
    if let Some(checks) = file.as_deref().and_then(recall) {
        return Ok(Proof { checks, remembered: true });
    }
    let proof = Proof { checks: self_test(settings)?, remembered: false };
    if proof.failed().next().is_none()
        && let Some(file) = &file
    {
        remember(file, &proof.checks);
    }
    Ok(proof)
}

/// Folder for what need not be computed twice: `$RPRAE_CACHE_DIR`, else `rprae` in the user's cache folder.
#[must_use]
pub fn cache_folder() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    folder("RPRAE_CACHE_DIR")
        .or_else(|| folder("XDG_CACHE_HOME").map(|cache| cache.join("rprae")))
        .or_else(|| folder("HOME").map(|home| home.join(".cache").join("rprae")))
}

/// What the outcome depends on, as a name.
fn file_name(settings: &SimulationSettings) -> String {
    let SimulationSettings { dt_secs, pgs_iterations, joint_form, .. } = settings;
    let parts = format!(
        "{} {} {} {dt_secs} {pgs_iterations} {joint_form:?}",
        program_sha256(),
        platform(),
        processor()
    );
    format!("physics-{}.json", &sha256_hex(parts.as_bytes())[..32])
}

/// Checks that passed earlier.
fn recall(file: &Path) -> Option<Vec<Check>> {
    let checks: Vec<Check> = serde_json::from_slice(&std::fs::read(file).ok()?).ok()?;
    (!checks.is_empty() && checks.iter().all(Check::passed)).then_some(checks)
}

fn remember(file: &Path, checks: &[Check]) {
    let folder = file.parent().unwrap_or(Path::new("."));
    // Finite numbers and strings always have a JSON form.
    let text = serde_json::to_string_pretty(checks).unwrap_or_default();
    let _ = std::fs::create_dir_all(folder).and_then(|()| write_file(file, text.as_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_passed_test_is_remembered_for_its_settings_and_a_spoilt_memory_is_not_believed() {
        let folder = tempfile::tempdir().unwrap();
        let settings = SimulationSettings::default();
        let first = prove(&settings, Some(folder.path())).unwrap();
        assert!(!first.remembered && first.failed().next().is_none(), "{first:?}");
        let second = prove(&settings, Some(folder.path())).unwrap();
        assert!(second.remembered);
        assert_eq!(second.checks, first.checks);

        let other = SimulationSettings { pgs_iterations: 6, ..SimulationSettings::default() };
        assert_ne!(file_name(&other), file_name(&settings));

        let file = folder.path().join(file_name(&settings));
        std::fs::write(&file, "[]").unwrap();
        assert!(recall(&file).is_none());
        let mut failed = first.checks;
        failed[0].measured = 1e9;
        std::fs::write(&file, serde_json::to_string(&failed).unwrap()).unwrap();
        assert!(recall(&file).is_none());
        assert!(!prove(&settings, Some(folder.path())).unwrap().remembered);
    }
}
