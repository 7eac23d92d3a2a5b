//! Sources to a prepared set: what is kept, where it goes, what is drawn.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use rprae::dataset::mmm::write_mmm;
use rprae::dataset::{Dataset, OpenOptions};
use rprae::features::prepare::{
    Account, CaptionSource, MotionSource, PrepareError, PrepareSettings, SplitLists, prepare,
};
use rprae::features::{BOS, EOS, PreparedSet, Split, TokenRule};
use rprae::motion::{Body, Frame, Motion};

fn write_motion(folder: &Path, id: &str, num_frames: usize, rate_hz: f64, height: f64) {
    std::fs::create_dir_all(folder).unwrap();
    let frames = (0..num_frames).map(|index| {
        let mut frame = Frame::ZERO;
        frame.root_position_m = [0.001 * index as f64, 0.0, height];
        frame.joint_angles_rad[20] = -0.001 * index as f64;
        frame
    });
    let motion = Motion::new(Body::with_default_mass(1.8), rate_hz, frames.collect()).unwrap();
    std::fs::write(folder.join(format!("{id}_mmm.xml")), write_mmm(&motion, "s")).unwrap();
}

fn write_captions(folder: &Path, id: &str, captions: &[&str]) {
    let json = serde_json::to_string(captions).unwrap();
    std::fs::write(folder.join(format!("{id}_annotations.json")), json).unwrap();
}

fn write_vectors(path: &Path, words: &[&str]) {
    let lines: Vec<String> = words.iter().enumerate().map(|(i, word)| format!("{word} {i} 1 -1\n")).collect();
    std::fs::write(path, lines.concat()).unwrap();
}

/// Ten motions of two captions each, two motions without captions, captions without a motion, and motions of bad length.
struct Sources {
    folder: tempfile::TempDir,
}

impl Sources {
    fn new() -> Self {
        let sources = Self { folder: tempfile::tempdir().unwrap() };
        let kit = sources.at("kit");
        for id in 0..10 {
            let id = format!("{id:05}");
            write_motion(&kit, &id, 200, 100.0, 0.9);
            write_captions(&kit, &id, &["a person walks", "somebody walks, slowly"]);
        }
        write_motion(&kit, "00010", 150, 100.0, 1.5);
        write_motion(&kit, "00011", 150, 100.0, 0.1);
        write_motion(&kit, "00020", 99, 100.0, 0.9);
        write_motion(&kit, "00021", 100, 100.0, 0.9);
        write_motion(&kit, "00022", 3000, 100.0, 0.9);
        write_motion(&kit, "00023", 3001, 100.0, 0.9);
        write_motion(&kit, "00024", 60, 60.0, 0.9);
        write_motion(&kit, "00025", 59, 60.0, 0.9);
        for id in ["00020", "00021", "00022", "00023", "00024", "00025"] {
            write_captions(&kit, id, &["a person sprints"]);
        }
        write_captions(&kit, "00099", &["a lost person walks"]);
        let words = ["person", "walks", "somebody", "slowly", "lost"];
        write_vectors(&sources.at("vectors.txt"), &words);
        sources
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn settings(&self) -> PrepareSettings {
        PrepareSettings {
            vectors: Some(self.at("vectors.txt")),
            motions: vec![MotionSource { path: self.at("kit"), ..MotionSource::default() }],
            ..PrepareSettings::default()
        }
    }
}

fn run(settings: &PrepareSettings) -> Result<(PreparedSet, Account), PrepareError> {
    let open = |source: &MotionSource, options: &OpenOptions| {
        Ok((Dataset::open(&source.path, options)?, Vec::new()))
    };
    prepare(settings, &open, &|_| {})
}

fn ids(set: &PreparedSet, split: Split) -> Vec<&str> {
    set.motions.iter().filter(|motion| motion.split == split).map(|motion| motion.id.as_str()).collect()
}

#[test]
fn the_paper_preparation_step_by_step() {
    let sources = Sources::new();
    let (set, account) = run(&sources.settings()).unwrap();
    set.check().unwrap();

    // Lengths of 1 to 30 s, whatever the rate; "sprints" has no vector, so these have no caption left and are extra.
    let from = &account.motions[0];
    assert_eq!((from.num_kept, from.num_short, from.num_long), (15, 2, 1));
    let kept: Vec<&str> = set.motions.iter().map(|motion| motion.id.as_str()).collect();
    assert!(["00021", "00022", "00024"].iter().all(|id| kept.contains(id)), "{kept:?}");
    let lengths = |id: &str| set.motions.iter().find(|motion| motion.id == id).unwrap().frames.len();
    assert_eq!((lengths("00021"), lengths("00022"), lengths("00000"), lengths("00024")), (10, 300, 20, 10));

    // Captions: 20 of the ten motions, one without its motion; three with a word without a vector.
    assert_eq!(account.corpus.num_captions, 24);
    assert_eq!((account.selection.num_captions_dropped, account.num_captions_filtered), (3, 3));
    assert_eq!((account.selection.num_motions_extra, account.selection.num_captions_extra), (5, 1));
    let words = ["<bos>", "<eos>", ",", "a", "lost", "person", "slowly", "somebody", "walks"];
    assert_eq!(set.vocabulary.words, words);
    let has: Vec<bool> = set.vocabulary.vectors.iter().map(Option::is_some).collect();
    assert_eq!(has, [false, false, false, false, true, true, true, true, true]);
    assert_eq!(set.captions[1].text, "somebody walks, slowly");
    let read: Vec<&str> = set.captions[1].words.iter().map(|w| words[*w as usize]).collect();
    assert_eq!(read, ["<bos>", "somebody", "walks", ",", "slowly", "<eos>"]);
    assert_eq!((set.captions[1].words[0], *set.captions[1].words.last().unwrap()), (BOS, EOS));

    // Eight, one and one of the ten; all pairs of each.
    assert_eq!((ids(&set, Split::Validation).len(), ids(&set, Split::Test).len()), (1, 1));
    assert_eq!((set.paired.len(), set.validation.len(), set.test.len()), (16, 2, 2));
    assert_eq!((set.non_paired_motions.len(), set.non_paired_captions.len()), (16 + 5, 16 + 1));

    // The range of the training split is -0.9 to 0.9; what never changes is 0.
    let values = |channel: usize| {
        let train = set.motions.iter().filter(|motion| motion.split == Split::Train);
        train.flat_map(|motion| &motion.frames).map(|frame| frame[channel]).collect::<Vec<f32>>()
    };
    for channel in [20, 44, 46] {
        let values = values(channel);
        let (low, high) = values.iter().fold((1.0_f32, -1.0_f32), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!((low + 0.9).abs() < 1e-6 && (high - 0.9).abs() < 1e-6, "{channel}: {low} {high}");
    }
    assert!(values(0).iter().all(|value| *value == 0.0));
    let frame = set.normalizer.denormalize(&set.motions[0].frames[5]);
    assert!((frame[44] - 0.05).abs() < 1e-6 && (frame[46] - 0.9).abs() < 1e-6, "{frame:?}");

    let text = account.text();
    assert!(text.contains("  train                                 2176         8\n"), "{text}");
}

#[test]
fn the_seed_and_nothing_else_decides() {
    let sources = Sources::new();
    let settings = sources.settings();
    let (set, _) = run(&settings).unwrap();
    assert_eq!(run(&settings).unwrap().0, set);
    let fingerprints: BTreeSet<String> = (0..5)
        .map(|seed| run(&PrepareSettings { seed, ..settings.clone() }).unwrap().0.fingerprint)
        .collect();
    assert!(fingerprints.len() > 1 && fingerprints.contains(&set.fingerprint));
}

#[test]
fn small_sets_are_drawn_from_larger_ones() {
    let sources = Sources::new();
    let draw = |non_paired, paired| {
        let settings = PrepareSettings { non_paired, paired, extras: false, ..sources.settings() };
        run(&settings).map(|(set, _)| set)
    };
    let (small, large) = (draw(Some(8), Some(3)).unwrap(), draw(Some(12), Some(5)).unwrap());
    let captions = |set: &PreparedSet| set.non_paired_captions.iter().copied().collect::<BTreeSet<_>>();
    let pairs = |set: &PreparedSet| set.paired.iter().map(|pair| pair.caption).collect::<BTreeSet<_>>();
    assert_eq!((captions(&small).len(), pairs(&small).len()), (8, 3));
    assert_eq!(small.non_paired_motions.len(), 8);
    assert!(pairs(&small).is_subset(&captions(&small)) && pairs(&small).is_subset(&pairs(&large)));
    assert!(captions(&small).is_subset(&captions(&large)));
    let vanilla = draw(None, Some(0)).unwrap();
    assert_eq!((vanilla.paired.len(), vanilla.non_paired_captions.len()), (0, 16));
    let error = draw(Some(17), None).unwrap_err().to_string();
    assert_eq!(error, "draw 17 pairs for non_paired: there are 16");
    assert_eq!(draw(Some(4), Some(5)).unwrap_err().to_string(), "draw 5 pairs for paired: there are 4");
}

#[test]
fn lists_of_ids_make_the_split() {
    let sources = Sources::new();
    let list = |name: &str, ids: &[&str]| {
        std::fs::write(sources.at(name), ids.join("\n")).unwrap();
        Some(sources.at(name))
    };
    let split = SplitLists {
        train: list("train", &["00000", "00001", "00002"]),
        validation: list("validation", &["00003"]),
        test: list("test", &["00004", "00010", "M00004"]),
    };
    let (set, account) = run(&PrepareSettings { split, ..sources.settings() }).unwrap();
    assert_eq!(ids(&set, Split::Validation), ["00003"]);
    assert_eq!(ids(&set, Split::Test), ["00004", "00010"]);
    // 00010 has no caption but is listed for the test, so nothing is learned from it.
    assert_eq!(ids(&set, Split::Train), ["00000", "00001", "00002", "00011", "00021", "00022", "00024"]);
    assert!(set.non_paired_motions.iter().all(|motion| set.motions[*motion].split == Split::Train));
    assert_eq!(account.selection.num_motions_in_no_list, 5);
    assert_eq!(account.selection.num_listed_absent, 1);
    assert_eq!((set.paired.len(), set.validation.len(), set.test.len()), (6, 2, 2));
}

#[test]
fn captions_and_motions_may_come_from_anywhere() {
    let sources = Sources::new();
    let cmu = sources.at("cmu");
    write_motion(&cmu, "01_01", 240, 120.0, 0.9);
    write_motion(&cmu, "00000", 240, 120.0, 0.9);
    let lines = [
        r#"{"id": "k1", "motion": "01_01", "captions": ["a person walks", "slowly walks"], "start_s": 0, "end_s": 1.99}"#,
        r#"{"id": "k2", "motion": "01_01", "captions": ["a person slowly"], "start_s": 0, "end_s": 0.5}"#,
        r#"{"id": "k3", "motion": "77_77", "captions": ["somebody walks"], "motion_here": false}"#,
        r#"{"id": "k4", "motion": "01_01", "captions": ["a person walks"]}"#,
    ];
    std::fs::write(sources.at("cmu.jsonl"), lines.join("\n")).unwrap();
    std::fs::write(sources.at("corpus.txt"), "a person\nwalks\n\nunheard of\n").unwrap();
    let mut settings = sources.settings();
    settings.motions.push(MotionSource { path: cmu, name: Some("c".to_owned()), ..MotionSource::default() });
    settings.captions = vec![
        CaptionSource { path: sources.at("cmu.jsonl"), motions: Some("c".to_owned()) },
        CaptionSource { path: sources.at("corpus.txt"), motions: None },
    ];
    let (set, account) = run(&settings).unwrap();
    let motion = set.motions.iter().position(|motion| motion.id == "c.01_01").unwrap();
    let texts = |of: Option<usize>| -> Vec<&str> {
        set.captions.iter().filter(|c| c.motion == of).map(|c| c.text.as_str()).collect()
    };
    assert_eq!(texts(Some(motion)), ["a person walks", "slowly walks"]);
    assert_eq!(
        texts(None),
        ["a lost person walks", "a person slowly", "somebody walks", "a person", "walks"]
    );
    assert_eq!((account.num_captions_partial, account.num_captions_repeated), (1, 1));
    assert!(set.motions.iter().any(|motion| motion.id == "kit.00000"));
    assert!(set.motions.iter().any(|motion| motion.id == "c.00000"));

    // Captions alone, and motions alone.
    let captions = PrepareSettings {
        motions: Vec::new(),
        captions: vec![settings.captions[1].clone()],
        ..settings.clone()
    };
    let (set, _) = run(&captions).unwrap();
    assert_eq!((set.motions.len(), set.captions.len(), set.non_paired_captions.len()), (0, 2, 2));
    let mut alone = sources.settings();
    alone.motions[0].without_captions = true;
    let (set, _) = run(&alone).unwrap();
    assert_eq!((set.captions.len(), set.paired.len(), set.non_paired_motions.len()), (0, 0, 15));
}

#[test]
fn words_without_vectors_can_be_kept() {
    let sources = Sources::new();
    let (set, account) = run(&PrepareSettings { keep_all_captions: true, ..sources.settings() }).unwrap();
    assert_eq!(account.selection.num_captions_dropped, 0);
    let sprints = set.vocabulary.index("sprints").unwrap() as usize;
    assert!(set.vocabulary.vectors[sprints].is_none());
    let (set, account) = run(&PrepareSettings { vectors: None, ..sources.settings() }).unwrap();
    assert!(set.vocabulary.vectors.iter().all(Option::is_none) && set.vocabulary.dimensions == 300);
    assert!(account.coverage.is_none());
    let strict = PrepareSettings { special_words: Vec::new(), ..sources.settings() };
    assert_eq!(run(&strict).unwrap().1.selection.subset.num_captions, 10);
}

#[test]
fn bad_inputs_are_skipped_by_name_and_the_good_ones_kept() {
    let sources = Sources::new();
    std::fs::write(sources.at("kit/00030_mmm.xml"), "<MMM>").unwrap();
    std::fs::write(sources.at("bad.jsonl"), "{\"caption\": \"walks\"}\n{\"caption\": 3}\n").unwrap();
    let mut settings = sources.settings();
    settings.captions = vec![CaptionSource { path: sources.at("bad.jsonl"), motions: None }];
    let (set, account) = run(&settings).unwrap();
    assert_eq!(account.skipped.len(), 2, "{:?}", account.skipped);
    assert!(account.skipped.iter().any(|skipped| skipped.id == "00030"));
    assert_eq!((set.paired.len(), account.selection.num_captions_extra), (16, 2));
    let nothing = PrepareSettings { min_secs: 29.99, max_secs: 29.99, extras: false, ..sources.settings() };
    let error = run(&nothing).unwrap_err().to_string();
    assert!(error.contains("no motion and no caption is left"), "{error}");
}

#[test]
fn all_recorded_captions_have_the_lengths_the_paper_prints() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA is not set, so there are no recorded captions to count");
        return;
    };
    let data = PathBuf::from(data);
    let captions = data.join("kit-ml/captions/kitml-captions-all.tsv");
    let count_in = |captions: &Path, tokens: TokenRule| {
        let settings = PrepareSettings {
            tokens,
            captions: vec![CaptionSource { path: captions.to_owned(), motions: None }],
            vectors: Some(data.join("word-vectors/googlenews-subset-31k.bin")),
            ..PrepareSettings::default()
        };
        let (set, account) = run(&settings).unwrap();
        let (corpus, kept) = (account.corpus, account.selection.subset);
        println!(
            "{tokens:?}: {} captions, {} words, {} to {}; kept {} captions, {} words, longest {}",
            corpus.num_captions,
            corpus.num_words,
            corpus.shortest,
            corpus.longest,
            kept.num_captions,
            kept.num_words,
            kept.longest
        );
        assert_eq!(set.captions.len(), kept.num_captions);
        account
    };
    let count = |tokens| count_in(&captions, tokens);
    let rule = TokenRule::default();
    let corpus = count(rule).corpus;
    assert_eq!((corpus.num_captions, corpus.num_words), (6353, 1645));
    assert_eq!((corpus.shortest, corpus.longest), (5, 44));
    // Only punctuation marks as words reach 44.
    assert_eq!(count(TokenRule { punctuation: false, ..rule }).corpus.longest, 41);
    count(TokenRule { lower_case: false, ..rule });
    assert_eq!(count(TokenRule { split_contractions: true, ..rule }).corpus.num_words, 1642);
    count(TokenRule { split_hyphens: true, ..rule });

    // Where full stops are still there, they are one word more and make no sentence longer than the longest.
    let original = data.join("kit-ml/captions/tmr-kitml-annotations.json.gz");
    let (without, with) =
        (count_in(&original, rule), count_in(&original, TokenRule { full_stop: true, ..rule }));
    assert_eq!(with.corpus.num_words, without.corpus.num_words + 1);
    assert_eq!((without.corpus.longest, with.corpus.longest), (44, 44));
}

#[test]
fn recorded_motions_and_captions_of_another_file_meet() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA is not set, so there are no recorded motions to prepare");
        return;
    };
    let data = PathBuf::from(data);
    let caption = |path: &str| CaptionSource { path: data.join(path), motions: None };
    let settings = PrepareSettings {
        motions: vec![MotionSource { path: data.join("kit-ml/dataset"), ..MotionSource::default() }],
        captions: vec![
            caption("kit-ml/captions/tmr-kitml-annotations.json.gz"),
            caption("cmu/kitml_cmu_captions.jsonl"),
            caption("cmu/captions.jsonl"),
            caption("bandai_namco/captions.jsonl"),
            caption("hdm05/captions.jsonl"),
        ],
        keep_all_captions: true,
        ..PrepareSettings::default()
    };
    let (set, account) = run(&settings).unwrap();
    for from in &account.captions {
        println!(
            "{}: {} captions, {} of motions, {} skipped",
            from.path.display(),
            from.num_captions,
            from.num_of_motions,
            from.num_skipped
        );
        assert_eq!(from.num_skipped, 0);
    }
    assert_eq!(account.motions[0].num_kept, 7);
    set.check().unwrap();
}
