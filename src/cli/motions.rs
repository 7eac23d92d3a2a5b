//! Options about motions that change nothing are refused: who gives one believes that it does.

use anyhow::bail;

use crate::dataset::{Dataset, Unstated};

/// An option, if it is given, and what it says about motions that do not say it themselves.
pub(super) type Hint = (&'static str, bool, Unstated);

/// Refuses the first option that is given and says what every motion of these datasets says itself.
pub(super) fn check_hints(hints: &[Hint], datasets: &[&Dataset]) -> anyhow::Result<()> {
    for &(flag, is_given, what) in hints {
        if is_given && !datasets.iter().any(|dataset| dataset.leaves_open(what)) {
            let why = match what {
                Unstated::Rate => "each of these motions states its rate",
                Unstated::Height => "each of these motions states the height of its body",
                Unstated::Skeleton => "none of these motions is motion capture of another skeleton",
            };
            bail!("use {flag}: {why}; leave out the option");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::OpenOptions;

    #[test]
    fn only_what_a_motion_leaves_open_can_be_said_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let open = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "").unwrap();
            Dataset::open(&path, &OpenOptions::default()).unwrap()
        };
        let datasets = ["a.xml", "b.csv", "c.npy", "d.bvh", "e.amc"].map(open);
        let all = [Unstated::Rate, Unstated::Height, Unstated::Skeleton];
        let open = all.map(|what| {
            let passes = |dataset: &Dataset| check_hints(&[("--it", true, what)], &[dataset]).is_ok();
            datasets.each_ref().map(passes)
        });
        assert_eq!(open[0], [false, true, true, false, true]);
        assert_eq!(open[1], [false, true, true, false, false]);
        assert_eq!(open[2], [false, false, true, true, true]);
        let hints = [("--rate", false, Unstated::Rate), ("--height", true, Unstated::Height)];
        let refused = check_hints(&hints, &[&datasets[0]]).unwrap_err().to_string();
        assert!(refused.contains("--height"), "{refused}");
        check_hints(&hints, &[&datasets[0], &datasets[1]]).unwrap();
    }
}
