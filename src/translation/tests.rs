//! Translation with small models that nobody trained: what holds for any weights.

use burn::tensor::Device;

use super::*;
use crate::features::{BOS, EOS, PreparedSet};
use crate::model::Rprae;
use crate::model::tests::tiny;
use crate::training::tests::four_pairs;

fn set() -> PreparedSet {
    let mut set = four_pairs();
    for channel in 0..NUM_CHANNELS {
        (set.normalizer.minimum[channel], set.normalizer.maximum[channel]) = (-0.4, 0.5);
    }
    set
}

fn translator(seed: u64) -> Translator {
    let set = set();
    Translator::new(Bundle::new(&Rprae::new(&tiny(), &set.vocabulary, seed, &Device::flex()), &tiny(), &set))
}

/// Latents of all captions and motions of the set.
fn latents(translator: &Translator) -> Vec<Vec<f32>> {
    let texts = ["word0002 word0003", "word0004 word0005 word0006", "word0005"];
    texts.iter().map(|text| translator.latent_of(&translator.read(text).unwrap())).collect()
}

fn search(translator: &Translator, latent: &[f32], search: &Search) -> Vec<Sentence> {
    search.sentences(&translator.bundle, &translator.tensor(latent))
}

#[test]
fn a_beam_of_one_is_greedy() {
    let mut compared = 0;
    for seed in 0..8 {
        let translator = translator(seed);
        for latent in latents(&translator) {
            let greedy = translator.bundle.decode_captions(&translator.tensor(&latent), 9).remove(0);
            // A model that was not trained may write the beginning of a sentence, which a search does not.
            if greedy.contains(&BOS) {
                continue;
            }
            let narrow = Search { most_words: Some(9), ..Search::default() };
            let found = search(&translator, &latent, &narrow);
            assert_eq!((found.len(), &found[0].words), (1, &greedy), "seed {seed}");
            compared += 1;
        }
    }
    assert!(compared >= 4, "only {compared} comparisons");
}

#[test]
fn the_probability_of_a_sentence_is_that_of_its_words() {
    let translator = translator(3);
    let wide = Search { beam: 5, n_best: 4, most_words: Some(7), ..Search::default() };
    for latent in latents(&translator) {
        let found = search(&translator, &latent, &wide);
        assert_eq!(found.len(), 4);
        for sentence in &found {
            let mut writing = translator.bundle.write(&translator.tensor(&latent));
            let (mut last, mut sum) = (BOS, 0.0);
            let end = sentence.has_ended.then_some(EOS);
            for &word in sentence.words.iter().chain(&end) {
                let (logarithms, next) = translator.bundle.next_words(&[last], &writing);
                sum += f64::from(logarithms[0][word as usize]);
                (writing, last) = (next, word);
            }
            assert!((sum - sentence.log_probability).abs() < 1e-4, "{sum} is not {sentence:?}");
            let count = (sentence.words.len() + usize::from(sentence.has_ended)) as f64;
            assert!((sentence.score - sentence.log_probability / count.powf(0.7)).abs() < 1e-12);
        }
        for pair in found.windows(2) {
            assert!(pair[0].score >= pair[1].score);
        }
        let distinct: BTreeSet<&str> = found.iter().map(|sentence| sentence.text.as_str()).collect();
        assert_eq!(distinct.len(), found.len());
    }
}

#[test]
fn a_wide_beam_finds_the_best_of_all_short_sentences() {
    let translator = translator(5);
    let latent = &latents(&translator)[0];
    // Every sentence of up to two words, one after the other.
    let all =
        Search { beam: 100, n_best: 50, length_exponent: 0.0, most_words: Some(3), ..Search::default() };
    let found: Vec<Sentence> =
        search(&translator, latent, &all).into_iter().filter(|sentence| sentence.has_ended).collect();
    let best = &found[0];
    let num_words = translator.bundle.vocabulary.words.len() as u32;
    let score = |words: &[u32]| {
        let mut writing = translator.bundle.write(&translator.tensor(latent));
        let (mut last, mut sum) = (BOS, 0.0);
        for &word in words.iter().chain(&[EOS]) {
            let (logarithms, next) = translator.bundle.next_words(&[last], &writing);
            sum += f64::from(logarithms[0][word as usize]);
            (writing, last) = (next, word);
        }
        sum
    };
    let singles = (2..num_words).map(|first| vec![first]);
    let pairs = (2..num_words).flat_map(|first| (2..num_words).map(move |second| vec![first, second]));
    let truth = [vec![]].into_iter().chain(singles).chain(pairs).map(|words| score(&words));
    let truth = truth.fold(f64::NEG_INFINITY, f64::max);
    assert!((best.log_probability - truth).abs() < 1e-4, "{} is not {truth}", best.log_probability);
}

#[test]
fn motions_have_the_length_asked_for_and_begin_as_training_motions_do() {
    let translator = translator(1);
    let latent = latents(&translator).remove(0);
    let body = Body::with_default_mass(1.6);
    let acted =
        translator.act(latent.clone(), &Acting { length_secs: Some(1.0), settle_secs: 0.0, body }).unwrap();
    assert_eq!((acted.motion.num_frames(), acted.motion.rate_hz(), acted.motion.body()), (11, 10.0, body));
    let start: [f32; NUM_CHANNELS] =
        std::array::from_fn(|channel| translator.bundle.config.start_frame[channel]);
    let first = translator.bundle.normalizer.denormalize(&start);
    assert_eq!(acted.motion.frames()[0].to_channels(), first);
    let free = translator.act(latent.clone(), &Acting::default()).unwrap();
    assert!((6..=12).contains(&free.motion.num_frames()));
    for secs in [0.0, -1.0, f64::NAN, 0.01] {
        let error = translator
            .act(latent.clone(), &Acting { length_secs: Some(secs), settle_secs: 0.0, body })
            .unwrap_err();
        assert!(matches!(error, TranslationError::Length { .. }), "{error}");
    }
    let error =
        translator.act(latent, &Acting { length_secs: Some(1e9), settle_secs: 0.0, body }).unwrap_err();
    assert!(matches!(error, TranslationError::TooLong { .. }), "{error}");
}

#[test]
fn what_settles_is_made_and_left_out() {
    let translator = translator(1);
    let latent = latents(&translator).remove(0);
    let acting = |length_secs, settle_secs| Acting { length_secs, settle_secs, ..Acting::default() };
    let act = |acting: &Acting| translator.act(latent.clone(), acting).unwrap().motion;
    let (whole, settled) = (act(&acting(Some(1.0), 0.0)), act(&acting(Some(0.7), 0.3)));
    assert_eq!(settled.frames(), &whole.frames()[3..]);
    let (free, later) = (act(&acting(None, 0.0)), act(&acting(None, 0.5)));
    assert_eq!(free.num_frames(), later.num_frames());
    assert_eq!(act(&acting(Some(1.0), f64::NAN)), whole);
}

#[test]
fn a_motion_means_the_same_at_any_rate() {
    let translator = translator(2);
    let latent = latents(&translator).remove(1);
    let motion =
        translator.act(latent, &Acting { length_secs: Some(2.0), ..Acting::default() }).unwrap().motion;
    let coarse = translator.describe(&motion, &Search::default()).unwrap();
    let fine = translator.describe(&upsampled(&motion, 100.0).unwrap(), &Search::default()).unwrap();
    for (a, b) in coarse.latent.iter().zip(&fine.latent) {
        assert!((a - b).abs() < 1e-5, "{a} is not {b}");
    }
    assert_eq!(coarse.sentences[0].words, fine.sentences[0].words);
}

#[test]
fn a_consensus_is_of_whole_sentences_and_says_how_much_they_agree() {
    let translator = translator(3);
    for choose in [Choose::Consensus, Choose::SampledConsensus] {
        let wide = Search { choose, beam: 12, n_best: 4, most_words: Some(6), seed: 5, ..Search::default() };
        for latent in latents(&translator) {
            let found = search(&translator, &latent, &wide);
            assert!((1..=4).contains(&found.len()));
            assert_eq!(found, search(&translator, &latent, &wide), "equal seeds, equal sentences");
            for (place, sentence) in found.iter().enumerate() {
                assert!(sentence.score > 0.0 && sentence.score <= 1.0 + 1e-12, "{sentence:?}");
                let before = place.checked_sub(1).map(|before| &found[before]);
                assert!(before.is_none_or(|it| it.score >= sentence.score && it.words != sentence.words));
                assert_eq!(sentence.has_ended, found[0].has_ended);
            }
        }
    }
    let draw = |seed| {
        let drawn =
            Search { choose: Choose::SampledConsensus, beam: 40, n_best: 40, seed, ..Search::default() };
        search(&translator, &latents(&translator)[0], &drawn)
    };
    assert_ne!(draw(1), draw(2));
    // A beam knows the probability of what was drawn.
    let all = Search { beam: 100, n_best: 100, most_words: Some(3), ..Search::default() };
    let beam = search(&translator, &latents(&translator)[0], &all);
    let mut compared = 0;
    for drawn in draw(1) {
        for same in beam.iter().filter(|it| it.has_ended && it.words == drawn.words) {
            assert!((same.log_probability - drawn.log_probability).abs() < 1e-4);
            compared += 1;
        }
    }
    assert!(compared > 0);
}

#[test]
fn motions_that_cannot_be_read_are_refused() {
    let translator = translator(2);
    let motion = |num_frames| {
        Motion::new(Body::with_default_mass(1.75), 100.0, vec![Frame::ZERO; num_frames]).unwrap()
    };
    let refused = |num_frames| translator.describe(&motion(num_frames), &Search::default()).unwrap_err();
    assert!(matches!(refused(1), TranslationError::TooShort { .. }));
    assert!(matches!(refused(10), TranslationError::TooShort { .. }));
    assert!(matches!(refused(20_000), TranslationError::TooLong { .. }));
    let long = translator.describe(&motion(500), &Search::default()).unwrap();
    assert!(long.warnings[0].contains("longer than any"), "{:?}", long.warnings);
}

#[test]
fn variations_differ_and_the_first_is_the_sentence_itself() {
    let translator = translator(4);
    let latent = latents(&translator).remove(0);
    let acting = Acting { length_secs: Some(0.8), ..Acting::default() };
    let made = translator.act_often(&latent, &acting, 3, 0.5, 7).unwrap();
    assert_eq!(made, translator.act_often(&latent, &acting, 3, 0.5, 7).unwrap());
    assert!(made.left_out.is_empty() && made.motions.iter().map(|(number, _)| *number).eq(0..3));
    let motions: Vec<Acted> = made.motions.into_iter().map(|(_, acted)| acted).collect();
    assert_eq!(motions[0], translator.act(latent.clone(), &acting).unwrap());
    assert!(motions[1].motion != motions[0].motion && motions[2].motion != motions[1].motion);
    let still = translator.act_often(&latent, &acting, 2, 0.0, 7).unwrap().motions;
    assert_eq!(still[0].1, still[1].1);
}

#[test]
fn one_bad_variation_leaves_the_others() {
    let translator = translator(4);
    let acted = translator.act(latents(&translator).remove(0), &Acting::default()).unwrap();
    let bad = || Err(TranslationError::TooManyWords { found: 7 });
    let found = Variants::sift([Ok(acted.clone()), bad(), Ok(acted.clone())].into_iter()).unwrap();
    assert_eq!(found.motions.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [0, 2]);
    assert_eq!(found.left_out, [(1, TranslationError::TooManyWords { found: 7 })]);
    assert!(Variants::sift([bad(), Ok(acted)].into_iter()).is_err(), "the sentence itself");
}

#[test]
fn unseen_words_enter_by_their_vectors() {
    let mut translator = translator(1);
    let sentence = "word0004 stroll";
    assert_eq!(translator.unknown_words([sentence]), BTreeSet::from(["stroll".to_owned()]));
    assert_eq!(translator.vectors_sha256(), None);
    // The vocabulary has no marks, so none of a reference counts.
    assert_eq!(translator.cut("Word0004  word0005."), "word0004 word0005");
    let vectors = |dimensions, vector: Vec<f32>| WordVectors {
        dimensions,
        vectors: BTreeMap::from([("stroll".to_owned(), vector)]),
        num_words: 1,
        warnings: Vec::new(),
    };
    let error = translator.add_vectors(vectors(2, vec![0.0; 2])).unwrap_err();
    assert_eq!(error, TranslationError::Dimensions { found: 2, expected: 6 });
    // The vector of a known word means what that word means.
    let known = translator.bundle.vocabulary.vectors[7].clone().unwrap();
    translator.add_vectors(vectors(6, known)).unwrap();
    let read = |text: &str| translator.latent_of(&translator.read(text).unwrap());
    for (a, b) in read(sentence).iter().zip(read("word0004 word0007")) {
        assert!((a - b).abs() < 1e-6);
    }
    let first = translator.vectors_sha256();
    translator.add_vectors(vectors(6, vec![0.5; 6])).unwrap();
    assert!(first.is_some() && first != translator.vectors_sha256());
}

#[test]
fn a_translator_may_be_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<Translator>();
}
