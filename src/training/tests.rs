//! Learning, end to end, on data small enough to be learned by heart.

use std::path::Path;

use burn::tensor::Device;

use super::*;
use crate::features::{
    CaptionFeatures, MirrorCount, MotionFeatures, Normalizer, Pair, PreparedSet, Root, Split,
};
use crate::model::ModelSettings;
use crate::model::tests::{motion, tiny, vocabulary};
use crate::motion::NUM_CHANNELS;

pub(crate) fn empty_set() -> PreparedSet {
    PreparedSet {
        rate_hz: 10.0,
        root: Root::Absolute,
        normalizer: Normalizer { minimum: vec![-1.0; NUM_CHANNELS], maximum: vec![1.0; NUM_CHANNELS] },
        vocabulary: vocabulary(9, 6),
        motions: Vec::new(),
        captions: Vec::new(),
        non_paired_motions: Vec::new(),
        non_paired_captions: Vec::new(),
        paired: Vec::new(),
        validation: Vec::new(),
        test: Vec::new(),
        fingerprint: "some data".to_owned(),
    }
}

/// Four motions of different lengths, a caption for each; they are their own validation pairs.
pub(crate) fn four_pairs() -> PreparedSet {
    let sentences: [&[u32]; 4] = [&[0, 2, 3, 1], &[0, 4, 5, 6, 1], &[0, 2, 7, 8, 3, 1], &[0, 5, 1]];
    let pairs: Vec<Pair> = (0..4).map(|place| Pair { motion: place, caption: place }).collect();
    PreparedSet {
        motions: (0..4)
            .map(|kind| MotionFeatures {
                id: format!("motion{kind}"),
                split: Split::Train,
                frames: motion(6 + 2 * kind, kind),
            })
            .collect(),
        captions: sentences
            .iter()
            .enumerate()
            .map(|(place, words)| CaptionFeatures {
                words: words.to_vec(),
                text: format!("caption {place}"),
                motion: Some(place),
                split: Split::Train,
            })
            .collect(),
        non_paired_motions: vec![0, 1, 2, 3],
        non_paired_captions: vec![0, 1, 2, 3],
        paired: pairs.clone(),
        validation: pairs,
        ..empty_set()
    }
}

pub(crate) fn settings(stage1: usize, stage2: usize) -> RunSettings {
    RunSettings {
        model: tiny(),
        training: TrainingSettings {
            batch_size: 3,
            stage1_iterations: Some(stage1),
            stage2_iterations: Some(stage2),
            alternate_every: 3,
            validate_every: 5,
            checkpoint_every: 4,
            ..TrainingSettings::default()
        },
        ..RunSettings::default()
    }
}

fn facts(set: &PreparedSet) -> RunFacts {
    RunFacts {
        rprae: "0".to_owned(),
        data: set.fingerprint.clone(),
        device: "cpu".to_owned(),
        parameters: Vec::new(),
        mirrored: None,
    }
}

fn run_in(path: &Path, settings: &RunSettings, begin: Begin) -> Result<Trained, TrainingError> {
    let set = four_pairs();
    let folder = RunFolder::open(path, settings, &facts(&set), begin)?;
    train(&set, settings, &Device::flex(), &folder, None, &mut |_| {})
}

#[test]
fn mirror_images_are_learned_from_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(2, 2);
    settings.training.mirror = true;
    let trained = run_in(folder.path(), &settings, Begin::New).unwrap();
    let set = four_pairs();
    assert_eq!(trained.learned(&set).paired.len(), 8);
    let facts = RunFacts { mirrored: Some(MirrorCount::of(&set)), ..facts(&set) };
    let told = card(&settings, &set, &facts, &trained, None, "");
    assert!(told.contains("mirror images of pairs, pairs without one | 4, 0 |"), "{told}");
    let learned_from = trained.bundle(&settings, &set).config.learned_from.unwrap();
    assert!(learned_from.has("motion0") && learned_from.has("motion0 (mirrored)"));

    settings.training.mirror = false;
    let error = run_in(folder.path(), &settings, Begin::Resume).unwrap_err().to_string();
    assert!(error.contains("training.mirror"), "{error}");
}

#[test]
fn four_pairs_are_learned_by_heart() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(300, 500);
    settings.model = ModelSettings { action_units: 32, description_units: 32, latent: 16, ..tiny() };
    settings.training.batch_size = 4;
    settings.training.alternate_every = 20;
    settings.training.learning_rate = 5e-3;
    settings.training.validate_every = 100;
    settings.training.checkpoint_every = 400;
    let trained = run_in(folder.path(), &settings, Begin::New).unwrap();

    let lines = read_metrics(&folder.path().join(METRICS_FILE)).unwrap();
    let last = lines.iter().rev().find_map(|line| match line {
        Line::Validation(found) => Some(found.clone()),
        Line::Iteration(_) => None,
    });
    let last = last.unwrap();
    // Every word of every caption, written from its motion; every motion, made from its caption.
    assert_eq!(last.m2t_word_accuracy, 1.0, "{last:?}");
    assert!(last.t2m_error < 0.05, "{last:?}");
    assert!(trained.best.unwrap().loss < 0.5, "{last:?}");
    let svg = curves(&lines, 300);
    assert_eq!(svg.matches("<polyline").count(), 8);
}

#[test]
fn equal_seeds_give_equal_weights_and_others_do_not() {
    let weights_of = |seed| {
        let folder = tempfile::tempdir().unwrap();
        let settings = RunSettings { seed, ..settings(7, 6) };
        crate::model::weights(&run_in(folder.path(), &settings, Begin::New).unwrap().model)
    };
    assert_eq!(weights_of(1), weights_of(1));
    assert_ne!(weights_of(1), weights_of(2));
}

#[test]
fn the_model_of_the_lowest_loss_or_the_last_one_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let kept = |keep, name: &str| {
        let mut settings = settings(0, 12);
        // Steps so large that the losses rise.
        settings.training =
            TrainingSettings { keep, learning_rate: 0.5, alternate_every: 0, ..settings.training };
        run_in(&folder.path().join(name), &settings, Begin::New).unwrap()
    };
    let (best, last) = (kept(Keep::Best, "best"), kept(Keep::Last, "last"));
    assert_eq!(best.iteration, best.best.unwrap().iteration);
    assert_eq!(best.best, last.best);
    assert_eq!((last.iteration, last.done), (12, 12));
}

#[test]
fn only_the_part_of_the_phase_learns() {
    let folder = tempfile::tempdir().unwrap();
    // Iterations 1 and 2 belong to the retrofit layer (n_ch = 3), 3 to 5 to the autoencoders.
    let before = crate::model::Rprae::new(&tiny(), &four_pairs().vocabulary, 1, &Device::flex());
    let before = crate::model::weights(&before);
    let changed = |iterations| {
        let path = folder.path().join(format!("{iterations}"));
        let mut settings = settings(0, iterations);
        settings.training.validate_every = 0;
        let set = PreparedSet { validation: Vec::new(), ..four_pairs() };
        let folder = RunFolder::open(&path, &settings, &facts(&set), Begin::New).unwrap();
        let trained = train(&set, &settings, &Device::flex(), &folder, None, &mut |_| {}).unwrap();
        let after = crate::model::weights(&trained.model);
        before
            .iter()
            .filter(|(name, tensor)| after[*name] != **tensor)
            .map(|(name, _)| name.split('.').next().unwrap().to_owned())
            .collect::<std::collections::BTreeSet<_>>()
            .into_iter()
            .collect::<Vec<_>>()
    };
    assert_eq!(changed(2), ["length", "retrofit"]);
    assert_eq!(changed(3), ["action", "description", "length", "retrofit"]);
}

#[test]
fn a_run_that_was_cut_off_ends_like_one_that_was_not() {
    let folder = tempfile::tempdir().unwrap();
    let whole = run_in(&folder.path().join("whole"), &settings(9, 14), Begin::New).unwrap();
    let cut = folder.path().join("cut");
    let set = four_pairs();
    for stop in [1, 6, 11, 21] {
        let begin = if cut.exists() { Begin::Resume } else { Begin::New };
        let run_folder = RunFolder::open(&cut, &settings(9, 14), &facts(&set), begin).unwrap();
        // A panic in the middle is as good as a kill: nothing after it runs.
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            train(&set, &settings(9, 14), &Device::flex(), &run_folder, None, &mut |event| {
                if let Event::Iterated(iteration) = event {
                    assert!(iteration.iteration < stop, "cut off here");
                }
            })
        }));
        assert!(result.is_err());
    }
    let resumed = run_in(&cut, &settings(9, 14), Begin::Resume).unwrap();
    assert_eq!(crate::model::weights(&whole.model), crate::model::weights(&resumed.model));
    let losses = |path: &Path| {
        let mut lines = read_metrics(&path.join(METRICS_FILE)).unwrap();
        for line in &mut lines {
            match line {
                Line::Iteration(found) => found.secs = 0.0,
                Line::Validation(found) => found.peak_memory_mib = None,
            }
        }
        lines
    };
    let lines = losses(&cut);
    assert_eq!(lines, losses(&folder.path().join("whole")));
    assert_eq!(lines.iter().filter(|line| matches!(line, Line::Iteration(_))).count(), 23);
}

#[test]
fn a_run_does_not_go_on_as_another() {
    let folder = tempfile::tempdir().unwrap();
    let ours = settings(3, 3);
    run_in(folder.path(), &ours, Begin::New).unwrap();
    let refused =
        |settings: &RunSettings, begin| run_in(folder.path(), settings, begin).unwrap_err().to_string();
    assert!(refused(&ours, Begin::New).contains("--overwrite"));
    let mut theirs = ours.clone();
    theirs.training.learning_rate = 0.5;
    let message = refused(&theirs, Begin::Resume);
    assert!(message.contains("training.learning_rate: 0.5 is not 0.001"), "{message}");

    let set = PreparedSet { fingerprint: "other data".to_owned(), ..four_pairs() };
    let error = RunFolder::open(folder.path(), &ours, &facts(&set), Begin::Resume).err().unwrap();
    assert!(error.to_string().contains("fingerprint of the data is other data"), "{error}");

    let held = RunFolder::open(folder.path(), &ours, &facts(&four_pairs()), Begin::Resume).unwrap();
    assert!(refused(&ours, Begin::Resume).contains("another process"));
    drop(held);
    run_in(folder.path(), &theirs, Begin::Overwrite).unwrap();
    let nowhere = folder.path().join("nowhere");
    assert!(
        run_in(&nowhere, &ours, Begin::Resume)
            .unwrap_err()
            .to_string()
            .contains("there is none; name its folder")
    );
}

#[test]
fn what_is_not_finite_stops_the_run_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(0, 12);
    settings.training.alternate_every = 0;
    settings.training.validate_every = 0;
    settings.training.checkpoint_every = 1;
    settings.training.learning_rate = 1e29;
    let message = run_in(folder.path(), &settings, Begin::New).unwrap_err().to_string();
    assert!(message.contains("not finite at iteration") && message.contains("motions motion"), "{message}");
    assert!(message.contains("is kept"), "{message}");
    assert!(folder.path().join(CHECKPOINTS).join("00000001").join("state.json").exists());
}

#[test]
fn a_run_stops_when_nothing_gets_better_if_asked_to() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(0, 40);
    settings.training.learning_rate = 0.0;
    settings.training.early_stop = Some(2);
    let trained = run_in(folder.path(), &settings, Begin::New).unwrap();
    assert_eq!((trained.iteration, trained.done), (5, 15));
}
