//! Scores of strings against NLTK, sacrebleu, rouge-score and pycocoevalcap.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::path::Path;

use rprae::evaluation::{
    Bleu, Cider, Corpus, Cut, Measurement, Resampling, RougeL, Segment, Smoothing, Tokenization,
};
use serde_json::Value;

/// Largest difference that counts as agreement.
const TOLERANCE: f64 = 1e-9;

fn golden(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/text").join(name);
    std::fs::read_to_string(path).unwrap()
}

fn json(name: &str) -> Value {
    serde_json::from_str(&golden(name)).unwrap()
}

fn corpus() -> Corpus {
    let segment = |line: &str| {
        let pair: Value = serde_json::from_str(line).unwrap();
        Segment {
            id: pair["id"].to_string(),
            hypothesis: pair["hypothesis"].as_str().unwrap().to_owned(),
            references: texts(&pair["references"]),
        }
    };
    Corpus::new(golden("pairs.jsonl").lines().map(segment).collect()).unwrap()
}

fn texts(value: &Value) -> Vec<String> {
    value.as_array().unwrap().iter().map(|text| text.as_str().unwrap().to_owned()).collect()
}

fn close(ours: f64, theirs: &Value, what: &str) {
    let theirs = theirs.as_f64().unwrap();
    assert!((ours - theirs).abs() < TOLERANCE, "{what}: {ours} is not {theirs}");
}

const NLTK: [(&str, Tokenization); 2] = [
    ("split", Tokenization { cut: Cut::Split, lowercase: false }),
    ("lower_words", Tokenization::LOWER_WORDS),
];

#[test]
fn tokens_are_those_of_the_references() {
    let golden = json("bleu.json");
    let corpus = corpus();
    for (name, tokenization) in NLTK {
        for (index, segment) in corpus.segments().iter().enumerate() {
            let theirs = &golden["nltk"][name]["sentence"][index];
            assert_eq!(tokenization.words(&segment.hypothesis), texts(&theirs["tokens"]), "{name} {index}");
            for (reference, tokens) in
                segment.references.iter().zip(theirs["reference_tokens"].as_array().unwrap())
            {
                assert_eq!(tokenization.words(reference), texts(tokens), "{name} {index}");
            }
        }
    }
    for (name, tokenization) in [("13a", "13a"), ("13a_lowercase", "13a-lc"), ("none_lowercase", "split-lc")]
    {
        let tokenization: Tokenization = tokenization.parse().unwrap();
        for (index, segment) in corpus.segments().iter().enumerate() {
            let theirs = golden["sacrebleu"][name]["sentence"][index]["tokens"].as_str().unwrap();
            let theirs: Vec<&str> = theirs.split_whitespace().collect();
            assert_eq!(tokenization.words(&segment.hypothesis), theirs, "{name} {index}");
        }
    }
}

#[test]
fn bleu_is_nltks() {
    let golden = json("bleu.json");
    let corpus = corpus();
    for (name, tokenization) in NLTK {
        let golden = &golden["nltk"][name];
        for (method, smoothing) in [("method0", "nltk0"), ("method1", "nltk1"), ("method4", "nltk4")] {
            let smoothing = Smoothing::by_name(smoothing).unwrap();
            let bleu = Bleu { tokenization, smoothing, effective_order: false };
            for (index, measurement) in bleu.measure(&corpus).iter().enumerate() {
                let order = format!("bleu{}", index + 1);
                let what = format!("{name} {method} {order}");
                close(measurement.score(), &golden["corpus"][&order][method], &what);
                for (id, ours) in measurement.segment_scores().into_iter().enumerate() {
                    close(ours, &golden["sentence"][id][&order][method], &format!("{what} of {id}"));
                }
            }
        }
    }
}

#[test]
fn counts_are_nltks() {
    let golden = json("bleu.json");
    let [.., fourth] = Bleu::PAPER.measure(&corpus());
    for (index, theirs) in golden["nltk"]["lower_words"]["sentence"].as_array().unwrap().iter().enumerate() {
        let row = fourth.statistics.row(index);
        for order in 0..4 {
            assert_eq!(Value::from(row[2 + order] as u64), theirs["modified_precision"][order][0]);
            assert_eq!(Value::from(row[6 + order] as u64), theirs["modified_precision"][order][1]);
        }
    }
}

#[test]
fn bleu_is_sacrebleus() {
    let golden = json("bleu.json");
    let corpus = corpus();
    for (name, tokenization) in
        [("none", "none"), ("none_lowercase", "none-lc"), ("13a", "13a"), ("13a_lowercase", "13a-lc")]
    {
        let golden = &golden["sacrebleu"][name];
        let tokenization: Tokenization = tokenization.parse().unwrap();
        let measure = |smoothing: &str, effective_order| {
            let smoothing = Smoothing::by_name(smoothing).unwrap();
            let [.., fourth] = Bleu { tokenization, smoothing, effective_order }.measure(&corpus);
            fourth
        };
        for smoothing in ["exp", "floor", "add-k", "none"] {
            let ours = 100.0 * measure(smoothing, false).score();
            close(ours, &golden["corpus"][smoothing]["score"], &format!("{name} {smoothing}"));
        }
        let effective = measure("exp", false);
        let full = Bleu { tokenization, ..Bleu::SACREBLEU };
        for (id, ours) in effective.segment_scores().into_iter().enumerate() {
            let theirs = &golden["sentence"][id];
            close(100.0 * ours, &theirs["exp_effective_order"]["score"], &format!("{name} of {id}"));
            let row = effective.statistics.row(id);
            close(
                100.0 * full.score(row, 4),
                &theirs["exp_full_order"]["score"],
                &format!("{name} full of {id}"),
            );
            assert_eq!(Value::from(row[0] as u64), theirs["exp_full_order"]["sys_len"]);
            assert_eq!(Value::from(row[1] as u64), theirs["exp_full_order"]["ref_len"]);
        }
    }
}

#[test]
fn rouge_and_cider_are_the_reference_programs() {
    let golden = json("captioning.json");
    let corpus = corpus();
    let check = |measurement: Measurement, name: &str| {
        close(measurement.score(), &golden[name]["corpus"], name);
        for (id, ours) in measurement.segment_scores().into_iter().enumerate() {
            close(ours, &golden[name]["segments"][id], &format!("{name} of {id}"));
        }
    };
    check(RougeL::CAPTIONING.measure(&corpus), "rouge_l_captioning");
    check(RougeL::ROUGE_SCORE.measure(&corpus), "rouge_l_rouge_score");
    check(Cider::CAPTIONING.measure(&corpus), "cider_d");
    check(Cider::PLAIN.measure(&corpus), "cider");
}

#[test]
fn resampling_puts_the_corpus_together_again() {
    // A resample of every segment once is the corpus, and one of a part is a corpus of that part.
    let corpus = corpus();
    let part = Corpus::new(corpus.segments()[40..90].to_vec()).unwrap();
    let (whole, alone) = (Bleu::PAPER.measure(&corpus), Bleu::PAPER.measure(&part));
    for (whole, alone) in whole.iter().zip(&alone) {
        assert!((whole.score_of(40..90) - alone.score()).abs() < 1e-12);
    }
    let interval = Resampling::default().interval(&whole[3]).unwrap();
    assert!(interval.low < whole[3].score() && whole[3].score() < interval.high, "{interval:?}");
}
