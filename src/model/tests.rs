//! The model as a whole.

use burn::module::Module;
use burn::tensor::Device;

use super::*;
use crate::motion::NUM_CHANNELS;

/// A vocabulary of the two marks and some words, of which the first has no vector.
pub(crate) fn vocabulary(num_words: usize, dimensions: usize) -> Vocabulary {
    let words = ["<bos>", "<eos>"].into_iter().map(str::to_owned);
    let vector =
        |word: usize| (word > 2).then(|| Draws::new(5, "vector", word as u64).uniform(dimensions, 0.3));
    Vocabulary {
        words: words.chain((2..num_words).map(|word| format!("word{word:04}"))).collect(),
        dimensions,
        vectors: (0..num_words).map(vector).collect(),
    }
}

pub(crate) fn tiny() -> ModelSettings {
    ModelSettings {
        action_units: 12,
        action_decoder_layers: 2,
        description_units: 10,
        latent: 8,
        retrofit_units: 9,
        retrofit_layers: 1,
        ..ModelSettings::default()
    }
}

/// A motion of sines that differ by channel.
pub(crate) fn motion(num_frames: usize, kind: usize) -> Vec<[f32; NUM_CHANNELS]> {
    let value = |t: usize, c: usize| {
        0.8 * (0.3 * t as f32 * (1.0 + kind as f32 / 3.0) + c as f32 * (kind + 1) as f32).sin()
    };
    (0..num_frames).map(|t| std::array::from_fn(|c| value(t, c))).collect()
}

#[test]
fn the_paper_has_fifteen_point_eight_million_parameters() {
    let model = Rprae::new(&ModelSettings::default(), &vocabulary(1331, 300), 1, &Device::flex());
    let counts = num_parameters(&model);
    let count = |name| counts.iter().find(|(part, _)| *part == name).unwrap().1;
    // Layers of 300-400-400-400-300 with biases.
    assert_eq!(count("retrofit layer"), 561_500);
    assert_eq!(count("description autoencoder"), 6_974_331);
    assert_eq!(count("action autoencoder"), 8_236_550);
    // The two marks and the one word without a vector; a weight for each latent and a bias.
    assert_eq!(count("word vectors"), 3 * 300);
    assert_eq!(count("length head"), 501);
    let paper: usize = 561_500 + 6_974_331 + 8_236_550;
    assert_eq!(paper, 15_772_381);
    assert_eq!(model.num_params(), paper + 900 + 501);
}

#[test]
fn weights_go_out_and_come_back() {
    let vocabulary = vocabulary(6, 4);
    let device = Device::flex();
    let (first, second) =
        (Rprae::new(&tiny(), &vocabulary, 1, &device), Rprae::new(&tiny(), &vocabulary, 2, &device));
    let saved = weights(&first);
    assert_ne!(saved, weights(&second));
    assert!(saved.contains_key("action.encoder.recurrent"), "{:?}", saved.keys());
    let loaded = load_weights(second.clone(), saved.clone()).unwrap();
    assert_eq!(weights(&loaded), saved);

    let refused = |change: fn(&mut std::collections::BTreeMap<String, NamedTensor>)| {
        let mut changed = saved.clone();
        change(&mut changed);
        load_weights(second.clone(), changed).unwrap_err().to_string()
    };
    let message = refused(|weights| {
        weights.remove("length.linear.bias");
    });
    assert_eq!(message, "find the weight length.linear.bias");
    let message = refused(|weights| {
        weights.get_mut("length.linear.bias").unwrap().values[0] = f32::NAN;
    });
    assert!(message.contains("not finite"), "{message}");
    let message = refused(|weights| {
        weights.insert("more".to_owned(), NamedTensor { shape: vec![1], values: vec![0.0] });
    });
    assert!(message.contains("more"), "{message}");
    let message = refused(|weights| {
        weights.get_mut("length.linear.bias").unwrap().shape = vec![1, 1];
    });
    assert!(message.contains("shape"), "{message}");
}

/// Loss values and the gradient of every weight, for batches padded to given widths.
fn learned(settings: &ModelSettings, motion_width: usize, caption_width: usize) -> (Vec<f32>, Vec<Vec<f32>>) {
    let device = Device::flex().autodiff();
    let model = Rprae::new(settings, &vocabulary(9, 6), 3, &device);
    let motions = [motion(5, 0), motion(9, 1), motion(2, 2)];
    let motions: Vec<Frames<'_>> = motions.iter().map(Vec::as_slice).collect();
    let captions: [&[u32]; 3] = [&[0, 4, 5, 1], &[0, 1], &[0, 2, 3, 7, 8, 1]];
    let motions = MotionBatch::padded(&motions, motion_width, &device);
    let captions = CaptionBatch::padded(&captions, caption_width, &device);
    let mut feed = Feeds::of(settings, 4, 0, 1.0);
    let losses =
        model.losses(&captions, &motions, Some(&[0, 1, 2]), settings, &LossSettings::default(), &mut feed);
    let values = [
        losses.description.clone(),
        losses.action.clone(),
        losses.binding.clone().unwrap(),
        losses.length.clone(),
    ];
    let values = values.map(|loss| loss.into_scalar::<f32>()).to_vec();
    let slopes = gradients(&model, &(losses.total() + losses.length.clone()).backward());
    assert_eq!(slopes.keys().collect::<Vec<_>>(), weights(&model).keys().collect::<Vec<_>>());
    (values, slopes.into_values().map(|slope| slope.values).collect())
}

#[test]
fn padding_changes_nothing_to_the_last_bit() {
    for decoding in [Decoding::ClosedLoop, Decoding::TeacherForcing, Decoding::ScheduledSampling] {
        for description_feedback in [DescriptionFeedback::ArgMax, DescriptionFeedback::Expectation] {
            let settings = ModelSettings { decoding, description_feedback, ..tiny() };
            let tight = learned(&settings, 9, 6);
            assert!(tight.1.iter().flatten().all(|value| value.is_finite()));
            assert!(tight.1.iter().all(|gradient| gradient.iter().any(|&value| value != 0.0)));
            assert_eq!(tight, learned(&settings, 31, 17), "{decoding:?} {description_feedback:?}");
        }
    }
}

#[test]
fn ways_of_decoding_differ() {
    let loss = |decoding, description_feedback| {
        learned(&ModelSettings { decoding, description_feedback, ..tiny() }, 9, 6).0
    };
    let closed = loss(Decoding::ClosedLoop, DescriptionFeedback::ArgMax);
    let forced = loss(Decoding::TeacherForcing, DescriptionFeedback::ArgMax);
    let expected = loss(Decoding::ClosedLoop, DescriptionFeedback::Expectation);
    assert_ne!(closed[..2], forced[..2]);
    assert_ne!(closed[0], expected[0]);
    // Encoders do not decode.
    assert_eq!(closed[2..], forced[2..]);
}
