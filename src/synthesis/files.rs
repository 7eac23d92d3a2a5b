//! The suite as files in the layout of KIT-ML, with a README that names each.

use std::fmt::Write as _;

use serde_json::json;
use sha2::{Digest, Sha256};

use super::{Feasibility, SuiteMotion};
use crate::dataset::mmm::write_mmm;

/// Name and content of a file.
pub type File = (String, String);

const README_HEAD: &str = "# Assets

`suite/` holds the motions that `eval-sim` runs when it is given none.
Every file there is made by this project: `cargo run --example generate_suite` writes all of them, this README included.
`skeletons/` says how other skeletons correspond to the humanoid; `bundle/` is a small trained model with its model card,
`recipe/` how it was made and the SHA-256 of its files.
No recording of a person went into the suite; the choreography, the captions and the sources of the published normative values
are in `src/synthesis/`.
Licence: MIT, as the rest of the project.
`captions.txt` holds the sentences, written for this project, that `eval-sim` makes motions of where a model is bundled.

The body is 1.75 m tall and weighs 68.9 kg; motions are sampled at 100 Hz and stored with six decimals (radians, metres).
`NNNNN_mmm.xml` is the motion, `NNNNN_annotations.json` its captions, `NNNNN_meta.json` where it comes from.
Motions from 90901 break one law of physics each; their captions say what was asked, not what is wrong.

| id | motion | seconds | possible | captions |
|---|---|---|---|---|
";

/// The files of `assets/suite`, sorted by name.
#[must_use]
pub fn suite_files(suite: &[SuiteMotion]) -> Vec<File> {
    let mut files: Vec<File> = suite
        .iter()
        .flat_map(|motion| {
            let meta = json!({
                "nb_annotations": motion.captions.len(),
                "source": {
                    "database": {"identifier": "rprae"},
                    "institution": {"identifier": "rprae", "name": "rprae, synthesised motion"},
                },
            });
            let name = |suffix: &str| format!("{}_{suffix}", motion.id);
            [
                (name("annotations.json"), format!("{}\n", json!(motion.captions))),
                (name("meta.json"), format!("{meta}\n")),
                (name("mmm.xml"), write_mmm(&motion.performance.motion, motion.name)),
            ]
        })
        .collect();
    files.sort();
    files
}

/// `assets/README.md` for these motions and files.
#[must_use]
pub fn suite_readme(suite: &[SuiteMotion], files: &[File]) -> String {
    let mut readme = README_HEAD.to_owned();
    for motion in suite {
        let verdict = match motion.feasibility {
            Feasibility::Possible => "yes",
            Feasibility::Floats => "no: the feet never touch the floor",
            Feasibility::Slides => "no: the standing feet slide",
            Feasibility::Jumps => "no: the body is elsewhere from one frame to the next",
        };
        let seconds = motion.performance.motion.duration_secs();
        let captions = motion.captions.join(" / ");
        let _ =
            writeln!(readme, "| {} | {} | {seconds:.2} | {verdict} | {captions} |", motion.id, motion.name);
    }
    readme.push_str("\nSHA-256 of each file:\n\n```text\n");
    for (name, content) in files {
        for byte in Sha256::digest(content.as_bytes()) {
            let _ = write!(readme, "{byte:02x}");
        }
        let _ = writeln!(readme, "  suite/{name}");
    }
    readme.push_str("```\n");
    readme
}
