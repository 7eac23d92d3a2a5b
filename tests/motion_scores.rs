//! Scores of motions against numpy, scipy, scikit-learn and dtw-python.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::path::Path;

use rprae::evaluation::Clusters;
use rprae::evaluation::motion::{
    Covariance, Embeddings, PoseComparison, Poses, Retrieval, diversity, frechet_distance,
};
use serde_json::Value;

fn golden() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/motion_scores.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// `value` of the places 1, 2, ..., row after row, as the golden program numbers them.
fn embeddings(rows: usize, columns: usize, value: impl Fn(f64) -> f64) -> Embeddings {
    let rows: Vec<Vec<f32>> = (0..rows)
        .map(|row| (0..columns).map(|column| value((row * columns + column + 1) as f64) as f32).collect())
        .collect();
    Embeddings::new(&rows).unwrap()
}

fn sine(seed: f64) -> impl Fn(f64) -> f64 {
    move |place| (place * (seed + 0.5)).sin()
}

fn close(ours: f64, theirs: &Value, tolerance: f64) {
    let theirs = theirs.as_f64().unwrap();
    assert!((ours - theirs).abs() <= tolerance * theirs.abs(), "{ours} is not {theirs}");
}

#[test]
fn distances_of_distributions_are_those_of_scipy() {
    let golden = golden();
    let (many, other) =
        (embeddings(60, 8, sine(1.0)), embeddings(60, 8, |place| 1.5 * sine(2.0)(place) + 0.25));
    close(frechet_distance(&many, &other, Covariance::Sample), &golden["fid_sample"], 1e-6);
    let (few, few_other) =
        (embeddings(12, 16, sine(3.0)), embeddings(12, 16, |place| 0.5 * sine(4.0)(place)));
    close(frechet_distance(&few, &few_other, Covariance::LedoitWolf), &golden["fid_ledoit_wolf"], 1e-6);
    close(diversity(&many, &Clusters::singles(60), "", "").unwrap().value, &golden["diversity"], 1e-9);
}

#[test]
fn precision_is_what_drawn_pools_approach() {
    let golden = golden();
    let many = embeddings(60, 8, sine(1.0));
    let near = embeddings(60, 8, |place| sine(1.0)(place) + 0.6 * sine(5.0)(place));
    let found =
        Retrieval::new(("caption", "motion"), "e", 60, |_, _| true, |a, b| many.distance(a, &near, b));
    for (measurement, theirs) in found.measure().iter().zip(golden["r_precision"].as_array().unwrap()) {
        // 20,000 pools of 32 leave an error of about 0.0005.
        assert!((measurement.score() - theirs.as_f64().unwrap()).abs() < 0.003, "{}", measurement.signature);
    }
}

#[test]
fn warping_is_that_of_dtw_python() {
    let golden = golden();
    let swing = |frames: usize, late: f64, seed: f64| {
        let frame = |frame: usize| -> Vec<[f64; 3]> {
            let time = frame as f64 / 10.0 - late;
            let value = |place: f64| {
                0.2 * (time * (0.7 + 0.1 * seed) + place).sin() + 0.1 * (time * 2.3 + place * seed).sin()
            };
            (0..3).map(|joint| std::array::from_fn(|axis| value((3 * joint + axis + 1) as f64))).collect()
        };
        Poses::new(10.0, &(0..frames).map(frame).collect::<Vec<_>>()).unwrap()
    };
    let cases = [(swing(50, 0.6, 1.0), swing(70, 0.0, 1.0)), (swing(40, 0.0, 1.0), swing(40, 0.0, 2.0))];
    for ((ours, theirs), golden) in cases.iter().zip(golden["warped"].as_array().unwrap()) {
        close(PoseComparison::new(ours, theirs).warped_mm, &golden["mean_mm"], 1e-9);
    }
}
