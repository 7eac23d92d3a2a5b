//! What sentences read back from motions are scored by.

use crate::plausibility::{Better, Metric};
use crate::simulation::Level;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "",
    level: Level::L0,
    better: Better::Higher,
    formula: "",
    empty: "absent for a motion without a sentence that the model can read, at L2 also for a rollout that failed, so that means of \
            L0 and L2 may be over different cases; what is lost is over those that have both",
    reference: "this project",
    signature: "v:1",
};

const BLEU: Metric = Metric {
    title: "caption BLEU",
    formula: "sentence BLEU-4 of the caption the model reads back from the motion, against the captions of the case cut by the \
              rule of the model's own words, which drops the marks it cannot write, 0..1; an order without a match counts 0.1; at \
              L0 of a motion that the same model made it says how consistent the model is with itself",
    reference: "Papineni et al. 2002; smoothing 1 of Chen and Cherry 2014",
    signature: "bleu4|tok:lower-words|references:model-words|smooth:nltk1[0.1]|v:2",
    ..SHARED
};

const LATENT: Metric = Metric {
    title: "caption latent",
    formula: "largest cosine between the model's latent of the motion and its latents of the captions of the case, -1..1",
    signature: "latent-cosine|references:best|v:1",
    ..SHARED
};

const COSINE: Metric = Metric {
    title: "caption cosine",
    formula: "largest cosine between the sentence vectors of the caption read back and of the captions of the case, -1..1",
    reference: "Gao, Yao, Chen 2021",
    empty: "absent without a sentence encoder, or a sentence that the model can read",
    signature: "sentence-cosine|references:best|v:1",
    ..SHARED
};

const N_BEST: Metric = Metric {
    better: Better::Neither,
    empty: "absent unless several motions are made of a sentence",
    signature: "rank:mean-share(skate,float,penetration,residual-gated,torque-limit)|v:1",
    ..SHARED
};

/// BLEU of the motion as it was given.
pub(super) static BLEU_L0: Metric = Metric { key: "l0/caption_bleu", ..BLEU };
/// BLEU of the motion as it was performed with assist.
pub(super) static BLEU_L2: Metric = Metric { key: "l2/caption_bleu", level: Level::L2, ..BLEU };
/// Their difference.
pub(super) static BLEU_LOST: Metric = Metric {
    key: "l2/caption_bleu_lost",
    title: "BLEU lost",
    level: Level::L2,
    better: Better::Lower,
    formula: "meaning lost to physics: l0/caption_bleu minus l2/caption_bleu of the same case; what the preparation changes \
              before (the retargets that the events of the case name) is in it",
    ..BLEU
};

/// Latent cosine of the motion as it was given.
pub(super) static LATENT_L0: Metric = Metric { key: "l0/caption_latent", ..LATENT };
/// Latent cosine of the motion as it was performed with assist.
pub(super) static LATENT_L2: Metric = Metric { key: "l2/caption_latent", level: Level::L2, ..LATENT };
/// Their difference.
pub(super) static LATENT_LOST: Metric = Metric {
    key: "l2/caption_latent_lost",
    title: "latent lost",
    level: Level::L2,
    better: Better::Lower,
    formula: "meaning lost to physics: l0/caption_latent minus l2/caption_latent of the same case; what the preparation changes \
              before (the retargets that the events of the case name) is in it",
    ..LATENT
};

/// Sentence cosine of the motion as it was given.
pub(super) static COSINE_L0: Metric = Metric { key: "l0/caption_cosine", ..COSINE };
/// Sentence cosine of the motion as it was performed with assist.
pub(super) static COSINE_L2: Metric = Metric { key: "l2/caption_cosine", level: Level::L2, ..COSINE };
/// Their difference.
pub(super) static COSINE_LOST: Metric = Metric {
    key: "l2/caption_cosine_lost",
    title: "cosine lost",
    level: Level::L2,
    better: Better::Lower,
    formula: "meaning lost to physics: l0/caption_cosine minus l2/caption_cosine of the same case; what the preparation changes \
              before (the retargets that the events of the case name) is in it",
    ..COSINE
};

/// What choosing saves of foot skate.
pub(super) static N_BEST_SKATE: Metric = Metric {
    key: "l0/n_best_skate_gain",
    title: "n-best skate gain",
    unit: "mm/s",
    formula: "l0/skate of the first motion made of the sentence, the one without noise, minus that of the one kept; this score is \
              among those chosen by",
    ..N_BEST
};
/// What choosing costs of movement: standing still is the most plausible motion of all.
pub(super) static N_BEST_DYNAMIC: Metric = Metric {
    key: "l0/n_best_dynamic_gain",
    title: "n-best dynamics gain",
    unit: "m/s",
    formula: "l0/dynamic_degree of the motion kept minus that of the first made of the sentence; negative when a stiller one \
              was kept",
    ..N_BEST
};
/// What choosing saves of unexplained force.
pub(super) static N_BEST_RESIDUAL: Metric = Metric {
    key: "l1/n_best_residual_gain",
    title: "n-best residual gain",
    unit: "% BW",
    level: Level::L1,
    formula: "l1/residual_force_gated of the first motion made of the sentence, the one without noise, minus that of the one \
              kept; this score is among those chosen by",
    ..N_BEST
};

/// All of them, sorted by key within a level.
pub static LANGUAGE_METRICS: &[&Metric] = &[
    &BLEU_L0,
    &COSINE_L0,
    &LATENT_L0,
    &N_BEST_DYNAMIC,
    &N_BEST_SKATE,
    &N_BEST_RESIDUAL,
    &BLEU_L2,
    &BLEU_LOST,
    &COSINE_L2,
    &COSINE_LOST,
    &LATENT_L2,
    &LATENT_LOST,
];

/// Whether a metric needs a sentence encoder.
pub(super) fn of_encoder(metric: &Metric) -> bool {
    metric.key.contains("caption_cosine")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lost_says_that_the_preparation_is_in_it() {
        let lost: Vec<&&Metric> =
            LANGUAGE_METRICS.iter().filter(|metric| metric.key.ends_with("_lost")).collect();
        assert_eq!(lost.len(), 3);
        for metric in lost {
            assert!(metric.formula.contains("what the preparation changes"), "{}", metric.key);
        }
    }
}
