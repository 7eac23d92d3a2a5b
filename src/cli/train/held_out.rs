//! How good a trained model is on the test pairs, beside what needs no model, for its card.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::evaluation::{Bleu, Corpus, Measurement, Resampling, Segment, Signature};
use crate::features::{BOS, EOS, Pair, PreparedSet};
use crate::model::{Bundle, Frames, MotionLength};
use crate::motion::NUM_CHANNELS;

/// Channels of joint angles, the first of the 50.
const NUM_ANGLES: usize = 44;
/// Motions a retrieval may name.
const TOP: usize = 3;

/// The test motions with their captions.
struct HeldOut<'a> {
    set: &'a PreparedSet,
    bundle: &'a Bundle,
    /// Place of each motion and of its captions.
    motions: Vec<(usize, Vec<usize>)>,
}

/// Scores on the test pairs as Markdown; nothing where there are fewer than two test motions.
pub(super) fn scores(set: &PreparedSet, bundle: &Bundle) -> String {
    let mut captions: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for pair in &set.test {
        captions.entry(pair.motion).or_default().push(pair.caption);
    }
    let held_out = HeldOut { set, bundle, motions: captions.into_iter().collect() };
    if held_out.motions.len() < 2 {
        return String::new();
    }
    let mut text = format!(
        "On the {} test motions with {} captions, none of them learned from, with 95 % bootstrap intervals over motions:\n\n",
        held_out.motions.len(),
        set.test.len()
    );
    held_out.push_captions(&mut text);
    held_out.push_motions(&mut text);
    text
}

impl HeldOut<'_> {
    fn frames(&self, motion: usize) -> Frames<'_> {
        &self.set.motions[motion].frames
    }

    fn sentence(&self, words: &[u32]) -> String {
        let words = words.iter().filter(|&&word| word != BOS && word != EOS);
        words.map(|&word| self.set.vocabulary.words[word as usize].as_str()).collect::<Vec<_>>().join(" ")
    }

    fn caption(&self, place: usize) -> String {
        self.sentence(&self.set.captions[place].words)
    }

    /// Captions written from the test motions, scored against those people wrote.
    fn push_captions(&self, text: &mut String) {
        let frames: Vec<Frames<'_>> = self.motions.iter().map(|(motion, _)| self.frames(*motion)).collect();
        let latent = self.bundle.encode_motions(&frames);
        let written = self.bundle.decode_captions(&latent, self.bundle.config.longest_caption);
        let ours: Vec<String> = written.iter().map(|words| self.sentence(words)).collect();
        let same = vec![self.most_frequent(); self.motions.len()];
        let nearest = self.motions.iter().map(|(motion, _)| self.caption_of_nearest(*motion)).collect();
        let (Some(ours), Some(same), Some(nearest)) = (self.bleu(ours), self.bleu(same), self.bleu(nearest))
        else {
            return;
        };
        text.push_str(
            "| captions of motions | BLEU-1 | BLEU-4 | model's BLEU-4 less this |\n|---|---|---|---|\n",
        );
        for (name, [first, .., fourth]) in [
            ("this model, most probable words", &ours),
            ("the most frequent caption of the training pairs, for every motion", &same),
            ("a caption of the training motion that is nearest in pose and length", &nearest),
        ] {
            let difference = if std::ptr::eq(fourth, &raw const ours[3]) {
                String::new()
            } else {
                Resampling::default().compare(&ours[3], fourth).map_or_else(
                    |error| error.to_string(),
                    |found| {
                        let interval = found.difference_interval.map_or(String::new(), |interval| {
                            format!(" [{:+.3}, {:+.3}]", interval.low, interval.high)
                        });
                        format!("{:+.3}{interval}", found.difference)
                    },
                )
            };
            // Writing to a string cannot fail.
            let _ = writeln!(text, "| {name} | {} | {} | {difference} |", told(first), told(fourth));
        }
        text.push('\n');
    }

    fn bleu(&self, hypotheses: Vec<String>) -> Option<[Measurement; 4]> {
        let segments = self.motions.iter().zip(hypotheses).map(|((motion, captions), hypothesis)| Segment {
            id: self.set.motions[*motion].id.clone(),
            hypothesis,
            references: captions.iter().map(|&place| self.caption(place)).collect(),
        });
        let corpus = Corpus::new(segments.collect()).ok()?;
        Some(Bleu::PAPER.measure(&corpus))
    }

    fn most_frequent(&self) -> String {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        for pair in &self.set.paired {
            *counts.entry(self.caption(pair.caption)).or_default() += 1;
        }
        let most = counts.into_iter().max_by(|a, b| a.1.cmp(&b.1).then_with(|| b.0.cmp(&a.0)));
        most.map(|(caption, _)| caption).unwrap_or_default()
    }

    /// Nearest by mean and spread of every channel and by the logarithm of the length.
    fn caption_of_nearest(&self, motion: usize) -> String {
        let wanted = summary(self.frames(motion));
        let distance = |pair: &&Pair| -> f64 {
            let found = summary(self.frames(pair.motion));
            found.iter().zip(&wanted).map(|(a, b)| (a - b).powi(2)).sum()
        };
        let nearest = self.set.paired.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map(|pair| self.caption(pair.caption)).unwrap_or_default()
    }

    /// Motions made from the test captions, and how well captions find their motions.
    fn push_motions(&self, text: &mut String) {
        let frames: Vec<Frames<'_>> = self.motions.iter().map(|(motion, _)| self.frames(*motion)).collect();
        let recorded = Bundle::numbers(&self.bundle.encode_motions(&frames));
        let pairs: Vec<(usize, &[u32])> = self
            .motions
            .iter()
            .enumerate()
            .flat_map(|(row, (_, captions))| {
                captions.iter().map(move |&place| (row, self.set.captions[place].words.as_slice()))
            })
            .collect();
        let captions: Vec<&[u32]> = pairs.iter().map(|(_, words)| *words).collect();
        let latent = self.bundle.encode_captions(&captions);
        let generated = self.bundle.decode_motions(&latent, None, &MotionLength::Predicted);
        let read: Vec<Frames<'_>> = generated.iter().map(Vec::as_slice).collect();
        let (described, read) =
            (Bundle::numbers(&latent), Bundle::numbers(&self.bundle.encode_motions(&read)));

        let rank = |from: &[f32], row: usize| {
            let distance = |to: &Vec<f32>| -> f32 { from.iter().zip(to).map(|(a, b)| (a - b).powi(2)).sum() };
            let own = distance(&recorded[row]);
            recorded.iter().filter(|other| distance(other) < own).count()
        };
        let of_motions = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let mut sums = vec![(0.0, 0_usize); self.motions.len()];
            for (place, &(row, _)) in pairs.iter().enumerate() {
                sums[row].0 += value(place);
                sums[row].1 += 1;
            }
            sums.into_iter().map(|(sum, count)| sum / count.max(1) as f64).collect()
        };
        let found = |vectors: &[Vec<f32>]| {
            of_motions(&|place| f64::from(u8::from(rank(&vectors[place], pairs[place].0) < TOP)))
        };
        let error = |place: usize| {
            let (made, true_) = (generated[place].len() as f64, frames[pairs[place].0].len() as f64);
            (made / true_).ln().abs()
        };
        let liveliness = |place: usize| speed(&generated[place]) / speed(frames[pairs[place].0]).max(1e-9);
        let chance = TOP as f64 / self.motions.len() as f64;
        text.push_str("| motions of captions | | chance or ideal |\n|---|---|---|\n");
        for (what, values, ideal) in [
            ("captions whose latent has their motion among its 3 nearest", found(&described), chance),
            ("generated motions whose latent has the recorded one among its 3 nearest", found(&read), chance),
            ("speed of the joints, generated over recorded", of_motions(&liveliness), 1.0),
            ("length, absolute logarithm of generated over recorded", of_motions(&error), 0.0),
        ] {
            let signature = Signature::new(what);
            let measurement = Measurement::of_values("held-out", signature, values);
            let _ = writeln!(text, "| {what} | {} | {ideal:.3} |", told(&measurement));
        }
        text.push('\n');
    }
}

/// A score with its interval.
fn told(measurement: &Measurement) -> String {
    let interval = Resampling::default().interval(measurement);
    let interval = interval.map_or(String::new(), |found| format!(" [{:.3}, {:.3}]", found.low, found.high));
    format!("{:.3}{interval}", measurement.score())
}

/// Mean and standard deviation of every channel, and the logarithm of the length.
fn summary(frames: Frames<'_>) -> Vec<f64> {
    let count = frames.len().max(1) as f64;
    let mean = |channel: usize| frames.iter().map(|frame| f64::from(frame[channel])).sum::<f64>() / count;
    let mut values = vec![count.ln()];
    for channel in 0..NUM_CHANNELS {
        let mean = mean(channel);
        let variance =
            frames.iter().map(|frame| (f64::from(frame[channel]) - mean).powi(2)).sum::<f64>() / count;
        values.extend([mean, variance.sqrt()]);
    }
    values
}

/// Mean absolute change of the joint angles a frame, normalised units.
fn speed(frames: Frames<'_>) -> f64 {
    let changes = frames.windows(2).flat_map(|pair| (0..NUM_ANGLES).map(move |c| pair[1][c] - pair[0][c]));
    let count = (frames.len().saturating_sub(1) * NUM_ANGLES).max(1);
    changes.map(|change| f64::from(change.abs())).sum::<f64>() / count as f64
}
