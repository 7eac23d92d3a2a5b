//! Tables 2 to 7 beside the paper's, and what the paper does not print.

use std::fmt::Write as _;

use super::amounts::Amount;
use super::collect::{Row, SeedScores};
use super::estimate::{Estimate, difference, estimate};
use super::grid::{Grid, Role};
use super::paper::{PaperRow, ROWS};
use crate::evaluation::{Measurement, Resampling, relative_performance};
use crate::report::Interval;

/// Scores of captions in the order of the paper's columns, and its column of each.
const TEXT_SCORES: [(&str, &str, Option<usize>); 7] = [
    ("bleu-4", "BLEU-4", Some(0)),
    ("rouge-l", "ROUGE-L", None),
    ("cider-d", "CIDEr-D", None),
    ("bertscore-p", "BERTScore P", Some(1)),
    ("bertscore-r", "R", Some(2)),
    ("bertscore-f", "F", Some(3)),
    ("cosine", "cosine", Some(4)),
];

/// Captions written, or read back.
type Pick = fn(&SeedScores) -> &[Measurement];

/// All tables as Markdown.
#[must_use]
pub fn tables(grid: &Grid, rows: &[Row]) -> String {
    let resampling = Resampling { num_resamples: grid.resamples, seed: 0 };
    let writer = Writer { rows, resampling };
    let sweep = grid.sweep();
    let main = |row: &Row| row.non_paired.is_none_or(|amount| amount == Amount::All);
    let swept = |row: &Row| row.paired == sweep && row.non_paired.is_some();
    let mut text = writer.introduction(grid);
    let captions: Pick = |seed| &seed.captions;
    let read_back: Pick = |seed| &seed.read_back;
    writer.text_table(&mut text, "Table 2: captions of held-out motions", captions, &main);
    if !grid.non_paired.is_empty() {
        writer.text_table(&mut text, "Table 3: the same by non-paired samples", captions, &swept);
    }
    writer.text_table(
        &mut text,
        "Table 4: captions read back from motions made from held-out captions",
        read_back,
        &main,
    );
    writer.relative_table(&mut text, "Table 5: what reading back keeps of the reference, percent", &main);
    if !grid.non_paired.is_empty() {
        writer.text_table(&mut text, "Table 6: Table 4 by non-paired samples", read_back, &swept);
        writer.relative_table(&mut text, "Table 7: Table 5 by non-paired samples, percent", &swept);
    }
    writer.stage1(&mut text);
    writer.baselines(&mut text);
    writer.motions(&mut text);
    paper_tables(&mut text);
    text
}

struct Writer<'a> {
    rows: &'a [Row],
    resampling: Resampling,
}

impl Writer<'_> {
    fn introduction(&self, grid: &Grid) -> String {
        let reference = &self.rows[0];
        let parts = &reference.seeds[0].parts;
        let motions: usize = parts.iter().map(|part| part.described.len()).sum();
        let captions: usize = parts.iter().map(|part| part.performed.len()).sum();
        let how = if grid.folds == 0 {
            "the test split of the prepared set".to_owned()
        } else {
            let parts = match grid.parts().len() {
                num if num == grid.folds => String::new(),
                num => format!(", {num} of the parts"),
            };
            format!(
                "{}-fold cross-validation{parts}: each motion is scored by the models that never saw it",
                grid.folds
            )
        };
        format!(
            "# Tables\n\nScored: {motions} motions and their {captions} captions ({how}), {} seeds. `[low, high]`: 95 % \
             intervals over motions\nor captions ({} draws) of the mean over seeds; `(a / b)`: the score of each seed. \
             Read back and embedded by the reference model\n(all pairs, no stage 1) of the same seed and part.\n",
            grid.seeds.len(),
            self.resampling.num_resamples
        )
    }

    /// Scores that were computed: those of the encoders may be absent.
    fn keys(&self, pick: Pick) -> Vec<(&'static str, &'static str, Option<usize>)> {
        let there = &pick(&self.rows[0].seeds[0]);
        TEXT_SCORES.into_iter().filter(|(key, ..)| there.iter().any(|found| found.key == *key)).collect()
    }

    fn estimate(&self, row: &Row, pick: Pick, key: &str) -> Option<Estimate> {
        Some(estimate(&row.over_seeds(pick, key)?, self.resampling))
    }

    fn text_table(&self, text: &mut String, title: &str, pick: Pick, is_shown: &dyn Fn(&Row) -> bool) {
        let keys = self.keys(pick);
        let headings: Vec<&str> = keys.iter().map(|(_, name, _)| *name).collect();
        begin(text, title, &headings);
        for row in self.rows.iter().filter(|row| is_shown(row)) {
            let cells: Vec<String> =
                keys.iter().map(|(key, ..)| show(self.estimate(row, pick, key).as_ref(), 3)).collect();
            line(text, row, &cells);
        }
    }

    fn relative_table(&self, text: &mut String, title: &str, is_shown: &dyn Fn(&Row) -> bool) {
        let keys = self.keys(|seed| &seed.read_back);
        let headings: Vec<&str> = keys.iter().map(|(_, name, _)| *name).collect();
        begin(text, title, &headings);
        for row in self.rows.iter().filter(|row| is_shown(row)) {
            let relative = |key: &str| {
                let reference = self.estimate(&self.rows[0], |seed| &seed.captions, key)?.value;
                let kept = self.estimate(row, |seed| &seed.read_back, key)?;
                let percent = |value| relative_performance(value, reference);
                let interval = match kept.interval {
                    Some(ends) => Some(Interval { low: percent(ends.low)?, high: percent(ends.high)? }),
                    None => None,
                };
                let seeds = kept.seeds.iter().map(|&value| percent(value)).collect::<Option<_>>()?;
                Some(Estimate { value: percent(kept.value)?, interval, seeds })
            };
            let cells: Vec<String> = keys.iter().map(|(key, ..)| show(relative(key).as_ref(), 1)).collect();
            line(text, row, &cells);
        }
        let _ = writeln!(
            text,
            "\nIntervals are those of what is read back; the score of the reference (Table 2, first row) is held fixed."
        );
    }

    /// Models with stage 1 against those without, at equal pairs.
    fn stage1(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "\n## What stage 1 gives: with minus without, at equal pairs\n\n`*`: the interval excludes 0. Intervals are over \
             motions and captions that both share; seeds are paired.\n\n\
             | pairs | non-paired | captions BLEU-4 | ROUGE-L | CIDEr-D | read back BLEU-4 | ROUGE-L | CIDEr-D |\n\
             |---|---|---|---|---|---|---|---|"
        );
        for row in self.rows.iter().filter(|row| row.role == Role::Proposed) {
            let without =
                self.rows.iter().find(|other| other.role == Role::Vanilla && other.paired == row.paired);
            let Some(without) = without else { continue };
            let mut cells = Vec::new();
            for pick in [(|seed| &seed.captions) as Pick, |seed| &seed.read_back] {
                for key in ["bleu-4", "rouge-l", "cider-d"] {
                    cells.push(self.differ((row, pick), (without, pick), key));
                }
            }
            line(text, row, &cells);
        }
    }

    fn differ(&self, (ours, pick): (&Row, Pick), (other, pick_other): (&Row, Pick), key: &str) -> String {
        let (Some(ours), Some(others)) = (ours.over_seeds(pick, key), other.over_seeds(pick_other, key))
        else {
            return "-".to_owned();
        };
        let found = difference(&ours, &others, self.resampling);
        let mark = if found.is_significant() { " *" } else { "" };
        format!("{:+.3} {}{mark}", found.value, ends(found.interval, 3))
    }

    /// Every model against captions that take no model.
    fn baselines(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "\n## Against captions without a model\n\nThe most frequent caption of the pairs learned from, and the caption of \
             the nearest of their motions in pose space.\n`*`: the interval of the difference excludes 0.\n\n\
             | pairs | non-paired | BLEU-4 | most frequent | difference | nearest | difference | CIDEr-D | most frequent | \
             difference | nearest | difference |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
        );
        for row in self.rows {
            let mut cells = Vec::new();
            for key in ["bleu-4", "cider-d"] {
                let value = |pick: Pick| {
                    self.estimate(row, pick, key)
                        .map_or_else(|| "-".to_owned(), |found| format!("{:.3}", found.value))
                };
                cells.push(value(|seed| &seed.captions));
                for baseline in [(|seed| &seed.most_frequent) as Pick, |seed| &seed.nearest] {
                    cells.push(value(baseline));
                    cells.push(self.differ((row, |seed| &seed.captions), (row, baseline), key));
                }
            }
            line(text, row, &cells);
        }
    }

    /// Scores of the motions made from held-out captions.
    fn motions(&self, text: &mut String) {
        let chance: Vec<String> = self.rows[0].seeds[0].retrievals[..3]
            .iter()
            .map(|found| format!("{:.3} of pools of {}", found.chance_level(3), found.pool()))
            .collect();
        let _ = writeln!(
            text,
            "\n## Motions made from held-out captions\n\nTop 3: the motion made is among the three nearest to its caption in \
             the reference's latent space (chance {}); its\ncaption is among the three nearest to it (chance {}); the recorded \
             motion is among the three nearest in pose space, without a\nmodel (chance {}). FID and diversity: mean over \
             seeds and parts. Pose errors in mm relative to the root's place and\nheading: as it comes, warped in time, and \
             the size of the shift in time that fits best. Frames: made over recorded.\n\n\
             | pairs | non-paired | motion by caption | caption by motion | recorded motion by poses | MM-Dist | FID | \
             diversity (recorded) | pose | warped | start offset, s | frames |\n|---|---|---|---|---|---|---|---|---|---|---|---|",
            chance[0], chance[1], chance[2]
        );
        for row in self.rows {
            let mut cells = Vec::new();
            for place in 0..3 {
                let seeds: Vec<Measurement> =
                    row.seeds.iter().map(|seed| seed.retrievals[place].measure()[2].clone()).collect();
                let seeds: Vec<&Measurement> = seeds.iter().collect();
                cells.push(show(Some(&estimate(&seeds, self.resampling)), 3));
            }
            let pick: Pick = |seed| &seed.motions;
            cells.push(show(self.estimate(row, pick, "mm-dist").as_ref(), 2));
            let parts = || row.seeds.iter().flat_map(|seed| &seed.parts);
            let mean = |value: &dyn Fn(&super::score::Outcome) -> f64| {
                parts().map(value).sum::<f64>() / parts().count().max(1) as f64
            };
            let set =
                |place: usize| mean(&move |part| part.sets.get(place).map_or(f64::NAN, |found| found.value));
            cells.push(format!("{:.2}", set(0)));
            cells.push(format!("{:.2} ({:.2})", set(1), set(2)));
            for (key, digits) in [("pose-error", 0), ("dtw-error", 0), ("start-offset-size", 2)] {
                cells.push(show(self.estimate(row, pick, key).as_ref(), digits));
            }
            let frames = mean(&|part| {
                let (made, recorded) = part
                    .performed
                    .iter()
                    .fold((0, 0), |sum, one| (sum.0 + one.frames, sum.1 + one.recorded_frames));
                made as f64 / recorded.max(1) as f64
            });
            cells.push(format!("{frames:.2}"));
            line(text, row, &cells);
        }
        let part = &self.rows[0].seeds[0].parts[0];
        let _ = writeln!(text, "\nFirst seed and part: `{}`.", part.sets[0].signature);
    }
}

fn begin(text: &mut String, title: &str, headings: &[&str]) {
    let rule = "---|".repeat(headings.len());
    let _ =
        writeln!(text, "\n## {title}\n\n| pairs | non-paired | {} |\n|---|---|{rule}", headings.join(" | "));
}

fn line(text: &mut String, row: &Row, cells: &[String]) {
    let paired = match row.paired {
        Amount::All => format!("all ({:.0})", row.num_pairs),
        Amount::Some(amount) => amount.to_string(),
    };
    let [captions, motions] = row.num_non_paired;
    let non_paired = match row.non_paired {
        None => "0".to_owned(),
        Some(Amount::All) => format!("all ({captions:.0} captions, {motions:.0} motions)"),
        Some(Amount::Some(amount)) => amount.to_string(),
    };
    let _ = writeln!(text, "| {paired} | {non_paired} | {} |", cells.join(" | "));
}

fn show(found: Option<&Estimate>, digits: usize) -> String {
    let Some(found) = found else { return "-".to_owned() };
    let seeds: Vec<String> = found.seeds.iter().map(|value| format!("{value:.digits$}")).collect();
    let seeds = if seeds.len() > 1 { format!(" ({})", seeds.join(" / ")) } else { String::new() };
    format!("{:.digits$} {}{seeds}", found.value, ends(found.interval, digits))
}

fn ends(interval: Option<Interval>, digits: usize) -> String {
    interval.map_or_else(String::new, |ends| format!("[{:.digits$}, {:.digits$}]", ends.low, ends.high))
}

/// What the paper prints, in its own numbers of pairs.
fn paper_tables(text: &mut String) {
    type Column = fn(&PaperRow) -> [f64; 5];
    let tables: [(&str, Column, usize); 3] = [
        ("Tables 2 and 3 of the paper", |row| row.captions, 3),
        ("Tables 4 and 6 of the paper", |row| row.read_back, 3),
        ("Tables 5 and 7 of the paper, percent, recomputed", PaperRow::relative_percent, 1),
    ];
    for (title, column, digits) in tables {
        begin(text, title, &["BLEU", "BERTScore P", "R", "F", "SimCSE"]);
        for row in &ROWS {
            let cells: Vec<String> = column(row).iter().map(|value| format!("{value:.digits$}")).collect();
            let _ = writeln!(text, "| {} | {} | {} |", row.paired, row.non_paired, cells.join(" | "));
        }
    }
    let _ = writeln!(
        text,
        "\nThe paper scores 273 motions of KIT-ML with models of 15.8 million numbers and means of three seeds, without \
         intervals;\nits BERTScore and SimCSE encoders are not named. Rows of other data and sizes do not compare in height, only \
         in order."
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::Panel;
    use crate::experiments::collect::join;
    use crate::experiments::score::tests::outcome;

    #[test]
    fn all_tables_stand_beside_the_papers() {
        let grid: Grid =
            toml::from_str("prepared = \"set\"\nseeds = [1]\npaired = [2, \"all\"]\nnon_paired = [3]\n")
                .unwrap();
        let row = |paired, role, non_paired| Row {
            paired,
            role,
            non_paired,
            num_pairs: 4.0,
            num_non_paired: [4.0, 4.0],
            seeds: vec![join(vec![outcome()], &Panel::default()).unwrap()],
        };
        let rows = [
            row(Amount::All, Role::Vanilla, None),
            row(Amount::Some(2), Role::Vanilla, None),
            row(Amount::Some(2), Role::Proposed, Some(Amount::All)),
            row(Amount::Some(2), Role::Proposed, Some(Amount::Some(3))),
        ];
        let text = tables(&grid, &rows);
        for number in 2..=7 {
            assert!(text.contains(&format!("## Table {number}: ")), "{number}");
        }
        assert!(text.contains("| all (4) | 0 |") && text.contains("| 2 | all (4 captions, 4 motions) |"));
        assert!(text.contains("| 4368 | 0 | 0.269 |"), "the paper's first row");
        // Equal models differ by nothing, and four motions are too few for an interval.
        assert!(text.contains("| +0.000 "), "{text}");
        assert!(!text.contains("NaN"), "{text}");
    }
}
