//! The model card of a run.

use std::fmt::Write as _;

use super::decay::Decay;
use super::folder::RunFacts;
use super::plan::Plan;
use super::record::Validation;
use super::run::Trained;
use super::settings::RunSettings;
use crate::features::{PreparedSet, Split};

/// What a bundle says of itself, as Markdown; `held_out` are scores on the test pairs, Markdown too.
#[must_use]
pub fn card(
    settings: &RunSettings,
    set: &PreparedSet,
    facts: &RunFacts,
    trained: &Trained,
    validation: Option<&Validation>,
    held_out: &str,
) -> String {
    let plan = Plan::new(&settings.training, set);
    let parameters: Vec<String> =
        facts.parameters.iter().map(|(part, count)| format!("| {part} | {count} |")).collect();
    let in_split = |split| set.motions.iter().filter(|motion| motion.split == split).count();
    let notes = settings.notes.trim();
    let notes =
        if notes.is_empty() { "None were given with `notes` in the settings of the run." } else { notes };
    let mut card = format!(
        "# A trained rPRAE model\n\n\
         Translates between descriptions and whole-body motions of 50 channels at {} Hz. Method: Toyoda, Suzuki, Hayashi,\n\
         Ogata, \"Learning Bidirectional Translation between Descriptions and Actions with Small Paired Data\", IEEE RA-L\n\
         7(4), 2022. Made by rprae {} on {}.\n\n\
         ## Data\n\n\
         | | |\n|---|---|\n\
         | motions in training, validation and test | {}, {}, {} |\n\
         | non-paired motions and captions of stage 1 | {}, {} |\n\
         | pairs of stage 2 | {} |\n\
         {}| words, of which with a given vector | {}, {} |\n\
         | fingerprint | `{}` |\n\n\
         ## Training\n\n\
         Iterations {} of {} (stage 1: {}, stage 2: {}); these are the weights after iteration {}. Seed {}, batches of {},\n\
         {}, Adam at {}{}. Everything else: `settings.toml` of the run.\n\n\
         | part | trained numbers |\n|---|---|\n{}\n\n",
        set.rate_hz,
        facts.rprae,
        facts.device,
        in_split(Split::Train),
        in_split(Split::Validation),
        in_split(Split::Test),
        set.non_paired_motions.len(),
        set.non_paired_captions.len(),
        set.paired.len(),
        mirrored(facts),
        set.vocabulary.words.len(),
        set.vocabulary.vectors.iter().flatten().count(),
        set.fingerprint,
        trained.done,
        plan.total(),
        plan.stage1,
        plan.stage2,
        trained.iteration,
        settings.seed,
        settings.training.batch_size,
        turns(settings.training.alternate_every),
        settings.training.learning_rate,
        match settings.training.learning_rate_decay {
            Decay::Constant => "",
            Decay::Cosine => ", falling to nothing through stage 2",
        },
        parameters.join("\n"),
    );
    if let Some(found) = validation {
        let losses = found.validation.named();
        let rows: Vec<String> =
            losses.iter().map(|(name, loss)| format!("| {name} loss | {loss:.4} |")).collect();
        // Writing to a string cannot fail.
        let _ = write!(
            card,
            "On the validation pairs, in closed loop:\n\n| | |\n|---|---|\n{}\n\
             | words of captions written from motions that are right, place by place | {:.1} % |\n\
             | error of motions made from captions, rms, normalised units | {:.4} |\n\n",
            rows.join("\n"),
            100.0 * found.m2t_word_accuracy,
            found.t2m_error,
        );
    }
    card.push_str(held_out);
    let _ = write!(
        card,
        "## Source and licence of the data\n\n{notes}\n\n\
         This folder holds the words of the training captions with their vectors, and statistics and first frames of the motions. Whoever\n\
         passes it on passes these on too: the licences of the captions, motions and word vectors apply.\n\n\
         ## Limits\n\n\
         Motions begin like the training motion whose latent is nearest, unless a first frame is given; their length is read off\n\
         the latent by a small head the paper does not have. Nothing here knows physics: simulate what it makes before\n\
         believing it.\n"
    );
    card
}

/// Which parts learn when.
fn turns(alternate_every: usize) -> String {
    match alternate_every {
        0 => "both parts learn at every iteration".to_owned(),
        every => format!("parts alternate every {every} iterations"),
    }
}

/// Rows on mirror images; none where there are none.
fn mirrored(facts: &RunFacts) -> String {
    facts.mirrored.map_or(String::new(), |count| {
        format!(
            "| mirror images of non-paired motions and captions, captions without one | {}, {}, {} |\n\
             | mirror images of pairs, pairs without one | {}, {} |\n",
            count.num_motions,
            count.num_captions,
            count.num_captions_left_out,
            count.num_pairs,
            count.num_pairs_left_out,
        )
    })
}
