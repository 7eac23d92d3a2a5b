//! The bundled model, as a clone has it: without the data it was trained on.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::collections::BTreeSet;
use std::path::Path;

use rprae::features::{BOS, EOS, TokenRule};
use rprae::manifest::hex;
use rprae::model::{self, Bundle, MotionLength};
use rprae::motion::{Body, Frame, Motion};
use sha2::{Digest, Sha256};

fn bundled() -> Bundle {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/bundle");
    Bundle::load(&folder, &model::cpu().device).unwrap()
}

fn act(bundle: &Bundle, sentence: &str) -> Motion {
    let rule = TokenRule { punctuation: false, ..TokenRule::default() };
    let words = rule.tokenize(sentence).into_iter().map(|word| bundle.vocabulary.index(&word).unwrap());
    let words: Vec<u32> = [BOS].into_iter().chain(words).chain([EOS]).collect();
    let latent = bundle.encode_captions(&[&words]);
    let frames = bundle.decode_motions(&latent, None, &MotionLength::Predicted).remove(0);
    bundle.motion_of(&frames, Body::with_default_mass(1.75)).unwrap()
}

fn describe(bundle: &Bundle, motion: &Motion) -> String {
    let frames = bundle.frames_of(motion).unwrap();
    let latent = bundle.encode_motions(&[&frames]);
    let words = bundle.decode_captions(&latent, bundle.config.longest_caption).remove(0);
    words.iter().map(|&word| bundle.vocabulary.words[word as usize].as_str()).collect::<Vec<_>>().join(" ")
}

/// Metres ahead between the first frame and the last; bodies look along y.
fn ahead_m(motion: &Motion) -> f64 {
    let place = |frame: Option<&Frame>| frame.unwrap().root_position_m[1];
    place(motion.frames().last()) - place(motion.frames().first())
}

fn speed_m_per_s(motion: &Motion) -> f64 {
    ahead_m(motion) / (motion.num_frames() as f64 / motion.rate_hz())
}

#[test]
fn its_files_are_those_of_the_checksums() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let sums = std::fs::read_to_string(assets.join("recipe/SHA256SUMS")).unwrap();
    let mut listed = BTreeSet::new();
    let mut num_bytes = 0;
    for line in sums.lines() {
        let (sum, name) = line.split_once("  ").unwrap();
        let bytes = std::fs::read(assets.join(name)).unwrap();
        let found = hex(&Sha256::digest(&bytes));
        assert_eq!(found, sum, "{name}");
        num_bytes += bytes.len();
        listed.insert(name.to_owned());
    }
    let entries = std::fs::read_dir(assets.join("bundle")).unwrap();
    let present =
        entries.map(|entry| format!("bundle/{}", entry.unwrap().file_name().to_str().unwrap())).collect();
    assert_eq!(listed, present);
    assert!(num_bytes <= 20 << 20, "{num_bytes} bytes");
}

#[test]
fn walking_and_running_get_somewhere_and_are_called_what_they_are() {
    let bundle = bundled();
    let walk = act(&bundle, "A person walks forward.");
    let run = act(&bundle, "A person runs forward.");
    assert!(ahead_m(&walk) > 1.2, "{} m", ahead_m(&walk));
    assert!(speed_m_per_s(&run) > 1.5 * speed_m_per_s(&walk), "{} m/s", speed_m_per_s(&run));
    for (motion, word) in [(&walk, "walk"), (&run, "run")] {
        let said = describe(&bundle, motion);
        assert!(said.contains(word), "{said}");
    }
}

#[test]
fn who_waves_stays_and_moves_the_arms() {
    let bundle = bundled();
    let wave = act(&bundle, "A person waves with the left hand.");
    assert!(ahead_m(&wave).abs() < 0.5, "{} m", ahead_m(&wave));
    let walk = act(&bundle, "A person walks forward.");
    assert!(ahead_m(&walk) > ahead_m(&wave) + 1.0);
}
