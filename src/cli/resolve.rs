//! From arguments to settings: defaults, then the settings file, then flags.

use super::retarget::read_skeleton;
use super::sim::SimArgs;
use crate::dataset::{Dataset, OpenOptions};
use crate::harness::{RunSettings, SettingsProblem};
use crate::simulation::{JointForm, Level};

/// The settings of a run, checked.
pub(super) fn settings(args: &SimArgs) -> Result<RunSettings, SettingsProblem> {
    let mut settings = match &args.config {
        Some(path) => RunSettings::read(path)?,
        None => RunSettings::default(),
    };
    let simulation = &mut settings.simulation;
    simulation.dt_secs = args.dt.unwrap_or(simulation.dt_secs);
    simulation.assist_limit = args.assist_limit.unwrap_or(simulation.assist_limit);
    simulation.joint_form = args.joint_form.unwrap_or(simulation.joint_form);
    settings.motions = args.motions.clone().or(settings.motions);
    settings.levels = args.levels.clone().unwrap_or(settings.levels);
    settings.limit = args.limit.or(settings.limit);
    settings.ids = args.ids.clone().unwrap_or(settings.ids);
    settings.seed = args.seed.unwrap_or(settings.seed);
    settings.table.rate_hz = args.rate.or(settings.table.rate_hz);
    settings.table.height_m = args.height.or(settings.table.height_m);
    settings.skeleton = args.skeleton.clone().or(settings.skeleton);
    settings.mass_kg = args.mass.or(settings.mass_kg);
    settings.recordings &= !args.no_recordings;
    settings.check()?;
    Ok(settings)
}

/// The motions the settings name.
pub(super) fn dataset(settings: &RunSettings) -> anyhow::Result<Dataset> {
    let Some(path) = &settings.motions else { return Ok(Dataset::bundled()) };
    let defaults = OpenOptions::default();
    let options = OpenOptions {
        rate_hz: settings.table.rate_hz,
        height_m: settings.table.height_m.unwrap_or(defaults.height_m),
        mass_kg: settings.mass_kg,
    };
    let dataset = Dataset::open(path, &options)?;
    Ok(match &settings.skeleton {
        Some(path) => dataset.with_skeleton(read_skeleton(path)?),
        None => dataset,
    })
}

/// A level by its name.
pub(super) fn level(text: &str) -> Result<Level, String> {
    match text.trim().to_ascii_uppercase().as_str() {
        "L0" => Ok(Level::L0),
        "L1" => Ok(Level::L1),
        "L2" => Ok(Level::L2),
        "L3" => Ok(Level::L3),
        _ => Err("expected some of L0, L1, L2, L3".to_owned()),
    }
}

/// A joint form by its name.
pub(super) fn joint_form(text: &str) -> Result<JointForm, String> {
    match text {
        "balls" => Ok(JointForm::Balls),
        "multibody" => Ok(JointForm::Multibody),
        _ => Err("expected balls or multibody".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_override_the_file_and_the_file_the_defaults() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.toml");
        std::fs::write(&path, "seed = 3\nlimit = 7\n[simulation]\nassist_limit = 0.1\nfriction = 0.5\n")
            .unwrap();
        let args = SimArgs {
            config: Some(path),
            limit: Some(2),
            assist_limit: Some(0.0),
            no_recordings: true,
            levels: Some(vec![Level::L2, Level::L0]),
            ..SimArgs::default()
        };
        let resolved = settings(&args).unwrap();
        assert_eq!((resolved.seed, resolved.limit, resolved.recordings), (3, Some(2), false));
        assert_eq!((resolved.simulation.assist_limit, resolved.simulation.friction), (0.0, 0.5));
        assert_eq!(resolved.levels, [Level::L0, Level::L2]);
        assert_eq!(settings(&SimArgs::default()).unwrap(), RunSettings::default());
    }

    #[test]
    fn numbers_outside_their_range_are_refused() {
        let refused = |args: SimArgs| settings(&args).unwrap_err().to_string();
        assert!(refused(SimArgs { dt: Some(0.0), ..SimArgs::default() }).contains("dt_secs"));
        assert!(refused(SimArgs { limit: Some(0), ..SimArgs::default() }).contains("limit"));
    }

    #[test]
    fn levels_have_names() {
        assert_eq!(level("l2"), Ok(Level::L2));
        assert!(level("L4").unwrap_err().contains("L0, L1, L2, L3"));
        assert!(level("2").is_err());
    }
}
