//! Scores over the number of pairs, with and without stage 1.

use crate::evaluation::{Measurement, Resampling};
use crate::experiments::amounts::Amount;
use crate::experiments::collect::{Row, SeedScores};
use crate::experiments::estimate::estimate;
use crate::experiments::grid::Role;
use crate::report::{Chart, Panel, Point, Series};

/// Data-efficiency curves of a grid, with 95 % intervals over motions and captions.
#[must_use]
pub fn efficiency(rows: &[Row], resampling: Resampling) -> Chart {
    type Pick = fn(&SeedScores) -> &[Measurement];
    let panels: [(&str, &str, Pick); 4] = [
        ("captions, BLEU-4", "bleu-4", |seed| &seed.captions),
        ("captions, CIDEr-D", "cider-d", |seed| &seed.captions),
        ("read back, BLEU-4", "bleu-4", |seed| &seed.read_back),
        ("motions warped, mm", "dtw-error", |seed| &seed.motions),
    ];
    let systems = [(Role::Vanilla, "without stage 1"), (Role::Proposed, "with stage 1")];
    let panel = |&(label, key, pick): &(&str, &str, Pick)| {
        let series = systems.map(|(role, name)| {
            let mut points: Vec<Point> = rows
                .iter()
                .filter(|row| row.role == role && row.non_paired.is_none_or(|amount| amount == Amount::All))
                .filter_map(|row| {
                    let found = estimate(&row.over_seeds(pick, key)?, resampling);
                    Some(Point { x: row.num_pairs, y: found.value, interval: found.interval })
                })
                .collect();
            points.sort_by(|a, b| a.x.total_cmp(&b.x));
            Series { name: name.to_owned(), points }
        });
        Panel { label: label.to_owned(), series: series.into() }
    };
    Chart {
        title: "What pairs give".to_owned(),
        x_label: "pairs of stage 2".to_owned(),
        panels: panels.iter().map(panel).collect(),
    }
}
