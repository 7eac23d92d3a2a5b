//! Tables 2 to 7 beside the paper's, and what the paper does not print.

use std::fmt::Write as _;

use super::amounts::Amount;
use super::collect::Row;
use super::differences::{Against, BASELINES, COMPARED, OF, Pick, WITHOUT_STAGE_1, differences, relative};
use super::estimate::{Difference, Estimate, estimate};
use super::grid::{Grid, Role};
use super::paper::{PaperRow, ROWS};
use super::records::REFERENCES;
use crate::evaluation::{Measurement, Resampling};
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
        "Table 4: captions read back from motions made from captions of held-out motions",
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
    writer.foot(&mut text);
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
        let unseen: usize = parts.iter().map(|part| part.num_unseen_captions).sum();
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
        let decoding = if grid.decoding.is_greedy() {
            String::new()
        } else {
            format!("Captions of motions are {}.\n", grid.decoding.text())
        };
        format!(
            "# Tables\n\nScored: {motions} motions and their {captions} captions ({how}), {} seeds. Of these captions \
             {unseen} are sentences that no pair of the\nreference has; the others people said of other motions too. Read back and \
             embedded by the reference model\n(all pairs, no stage 1) of the same seed and part. The foot says what \
             intervals and signs mean.\n{decoding}",
            grid.seeds.len(),
        )
    }

    /// What the numbers are, and what they are not.
    fn foot(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "\n## How to read these tables\n\n\
             - `[low, high]`: 95 % interval of the mean over seeds. Motions are drawn with replacement ({} draws), each with \
             all its captions, since these are not independent; two systems are compared over the same draws. Below five \
             motions there is none.\n\
             - `± s (a / b)`: the standard deviation over seeds, and the value of each. It is not in the interval: another \
             seed may move a number by as much again.\n\
             - `*`: the interval of a difference excludes 0, and every seed is on the same side of it.\n\
             - References are {REFERENCES}.",
            self.resampling.num_resamples
        );
        let there = self.keys(|seed| &seed.captions);
        let absent: Vec<&str> =
            TEXT_SCORES.iter().filter(|score| !there.contains(score)).map(|(key, ..)| *key).collect();
        if !absent.is_empty() {
            let _ = writeln!(
                text,
                "- Not scored, for want of an encoder (`--encoder`, `--sentence-encoder`): {}.",
                absent.join(", ")
            );
        }
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
            let relative = |key: &str| relative(self.rows, row, key, self.resampling);
            let cells: Vec<String> = keys.iter().map(|(key, ..)| show(relative(key).as_ref(), 1)).collect();
            line(text, row, &cells);
        }
        let _ = writeln!(
            text,
            "\nIntervals are those of what is read back; the score of the reference (Table 2, first row) is held fixed."
        );
    }

    /// The scores that are compared, those that were computed.
    fn compared(&self) -> Vec<(&'static str, &'static str)> {
        let there = self.keys(|seed| &seed.captions);
        let there = there.into_iter().filter(|(key, ..)| COMPARED.contains(key));
        there.map(|(key, name, _)| (key, if key == "bertscore-f" { "BERTScore F" } else { name })).collect()
    }

    /// Models with stage 1 against those without, at equal pairs.
    fn stage1(&self, text: &mut String) {
        let keys = self.compared();
        let names = ["captions", "read back"]
            .map(|of| keys.iter().map(|(_, name)| format!("{of} {name}")).collect::<Vec<_>>());
        let names = names.concat();
        let headings: Vec<&str> = names.iter().map(String::as_str).collect();
        begin(text, "What stage 1 gives: with minus without, at equal pairs", &headings);
        for row in self.rows.iter().filter(|row| row.role == Role::Proposed) {
            let found = differences(self.rows, row, self.resampling);
            let mut cells = Vec::new();
            for (of, _) in OF {
                cells.extend(keys.iter().map(|(key, _)| differ(&found, (of, WITHOUT_STAGE_1), key)));
            }
            line(text, row, &cells);
        }
    }

    /// Every model against captions that take no model.
    fn baselines(&self, text: &mut String) {
        let keys = self.compared();
        let mut headings = Vec::new();
        for (_, name) in &keys {
            headings.extend([*name, "most frequent", "difference", "nearest", "difference"]);
        }
        begin(text, "Against captions without a model", &headings);
        for row in self.rows {
            let found = differences(self.rows, row, self.resampling);
            let mut cells = Vec::new();
            for (key, _) in &keys {
                let value = |pick: Pick| {
                    self.estimate(row, pick, key)
                        .map_or_else(|| "-".to_owned(), |found| format!("{:.3}", found.value))
                };
                cells.push(value(|seed| &seed.captions));
                for (name, baseline) in BASELINES {
                    cells.push(value(baseline));
                    cells.push(differ(&found, ("captions", name), key));
                }
            }
            line(text, row, &cells);
        }
        let _ = writeln!(
            text,
            "\nThe most frequent caption of the pairs learned from, and the caption of the nearest of their motions in pose \
             space."
        );
    }

    /// Scores of the motions made from captions of held-out motions.
    fn motions(&self, text: &mut String) {
        let chance: Vec<String> = self.rows[0].seeds[0].retrievals[..3]
            .iter()
            .map(|found| format!("{:.3} of pools of {}", found.chance_level(3), found.pool()))
            .collect();
        let _ = writeln!(
            text,
            "\n## Motions made from captions of held-out motions\n\nTop 3: the motion made is among the three nearest to its caption in \
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
        // Where one kind is short, what there was.
        Some(Amount::Some(amount))
            if [captions, motions].iter().any(|&found| found.round() as usize != amount) =>
        {
            format!("{amount} ({captions:.0} captions, {motions:.0} motions)")
        }
        Some(Amount::Some(amount)) => amount.to_string(),
    };
    let _ = writeln!(text, "| {paired} | {non_paired} | {} |", cells.join(" | "));
}

fn show(found: Option<&Estimate>, digits: usize) -> String {
    let Some(found) = found else { return "-".to_owned() };
    let seeds = over_seeds(found.spread, &found.seeds, |value| format!("{value:.digits$}"));
    format!("{:.digits$} {}{seeds}", found.value, ends(found.interval, digits))
}

/// A difference among those of a row.
fn differ(found: &[Against], (of, against): (&str, &str), key: &str) -> String {
    let wanted = |one: &&Against| (one.of, one.against, one.key) == (of, against, key);
    let Some(Against { difference, .. }) = found.iter().find(wanted) else { return "-".to_owned() };
    let Difference { value, interval, spread, seeds } = difference;
    let mark = if difference.is_significant() { " *" } else { "" };
    let seeds = over_seeds(*spread, seeds, |value| format!("{value:+.3}"));
    format!("{value:+.3} {}{seeds}{mark}", ends(*interval, 3))
}

/// How far seeds differ, and each of them; nothing for a single one.
fn over_seeds(spread: Option<f64>, seeds: &[f64], show: impl Fn(f64) -> String) -> String {
    let Some(spread) = spread else { return String::new() };
    let seeds: Vec<String> = seeds.iter().map(|&value| show(value)).collect();
    format!(" ± {} ({})", show(spread).trim_start_matches('+'), seeds.join(" / "))
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
pub(super) mod tests {
    use super::*;
    use crate::evaluation::Panel;
    use crate::experiments::collect::join;
    use crate::experiments::score::tests::outcome;

    /// Four rows of equal scores, as many seeds of each.
    pub(in crate::experiments) fn rows(num_seeds: usize) -> [Row; 4] {
        let seed = join(vec![outcome()], &Panel::default()).unwrap();
        let row = |paired, role, non_paired| Row {
            paired,
            role,
            non_paired,
            num_pairs: 4.0,
            num_non_paired: [4.0, 4.0],
            seeds: vec![seed.clone(); num_seeds],
        };
        [
            row(Amount::All, Role::Vanilla, None),
            row(Amount::Some(2), Role::Vanilla, None),
            row(Amount::Some(2), Role::Proposed, Some(Amount::All)),
            row(Amount::Some(2), Role::Proposed, Some(Amount::Some(3))),
        ]
    }

    pub(in crate::experiments) fn grid(seeds: &str) -> Grid {
        toml::from_str(&format!(
            "prepared = \"set\"\nseeds = {seeds}\npaired = [2, \"all\"]\nnon_paired = [3]\n"
        ))
        .unwrap()
    }

    #[test]
    fn seeds_are_shown_beside_the_interval_over_motions() {
        let mut rows = rows(2);
        // The second seed of the model with stage 1 writes something else.
        let other: Vec<f64> = vec![0.5; 4];
        for found in rows[2].seeds[1].captions.iter_mut().filter(|found| found.key == "rouge-l") {
            *found = Measurement::of_values(found.key, found.signature.clone(), other.clone());
        }
        let text = tables(&grid("[1, 2]"), &rows);
        let found = differences(&rows, &rows[2], Resampling::default());
        let one = found.iter().find(|one| one.against == WITHOUT_STAGE_1 && one.key == "rouge-l").unwrap();
        let spread = one.difference.spread.unwrap();
        assert!(spread > 0.0 && text.contains(&format!("± {spread:.3} (+0.000 / ")), "{text}");
        assert!(text.contains("each with all its captions") && text.contains("± s (a / b)"), "{text}");
        // Three non-paired samples were asked for, and there were four of each.
        assert!(text.contains("| 3 (4 captions, 4 motions) |"), "{text}");
        assert!(text.contains("cosine.") && text.contains("Not scored"), "{text}");
    }

    #[test]
    fn all_tables_stand_beside_the_papers() {
        let grid = grid("[1]");
        let rows = rows(1);
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
