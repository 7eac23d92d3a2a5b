//! Corpus BLEU beside sacrebleu and BERTScore beside `bert_score`, from strings to the score of the corpus.
//!
//! `cargo bench --bench text_scores` makes captions of the usual length, scores them on both sides in turn, and prints the
//! ratio of medians. Both sides take the same number of threads, `RPRAE_THREADS` (default 2).
//! BERTScore needs `RPRAE_MINILM`, the folder of an encoder; both sides load the same weights, which is not timed, and
//! neither remembers a sentence from one round to the next.
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.

#[path = "beside/peer.rs"]
mod peer;

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use rprae::evaluation::encoder::Encoder;
use rprae::evaluation::{BertScore, Bleu, Corpus, EmbeddedSegment, Segment};

use peer::{Peer, median, script};

/// Segments for BLEU, about the captions of KIT-ML.
const BLEU_SEGMENTS: usize = 6_000;
/// Segments for BERTScore, about a test split.
const BERT_SEGMENTS: usize = 600;
const BLEU_ROUNDS: usize = 9;
const BERT_ROUNDS: usize = 5;
/// Layer of the encoder that counts.
const LAYER: usize = 6;

fn main() -> Result<(), Box<dyn Error>> {
    let threads = std::env::var("RPRAE_THREADS").unwrap_or_else(|_| "2".to_owned());
    rayon::ThreadPoolBuilder::new().num_threads(threads.parse()?).build_global()?;
    let folder = tempfile::tempdir()?;
    let minilm = std::env::var_os("RPRAE_MINILM").map(PathBuf::from);

    let corpus = captions(BLEU_SEGMENTS)?;
    let pairs = write_pairs(folder.path(), &corpus)?;
    let ours = || Ok(100.0 * Bleu::SACREBLEU.measure(&corpus)[3].score());
    let mut command = script("text_scores.py");
    command.arg(&pairs).arg(&threads);
    compare("corpus BLEU", &corpus, &mut command, "bleu", BLEU_ROUNDS, ours)?;

    let Some(minilm) = minilm else {
        println!("BERTScore is left out: RPRAE_MINILM names no encoder");
        return Ok(());
    };
    let corpus = captions(BERT_SEGMENTS)?;
    let pairs = write_pairs(folder.path(), &corpus)?;
    let mut encoder = Encoder::open(&minilm, Some(LAYER))?;
    let ours = || {
        encoder.forget();
        bert_score_f(&encoder, &corpus)
    };
    let mut command = script("text_scores.py");
    command.arg(&pairs).arg(&threads).arg(&minilm).arg(LAYER.to_string());
    compare("BERTScore", &corpus, &mut command, "bert", BERT_ROUNDS, ours)
}

/// Runs both sides in turn and prints medians and ratio.
fn compare(
    name: &str,
    corpus: &Corpus,
    command: &mut Command,
    task: &str,
    rounds: usize,
    mut ours: impl FnMut() -> Result<f64, Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    println!("{name}: {} segments, {} references", corpus.len(), corpus.references().count());
    let started = Peer::start(command).map_err(|error| println!("the peer is left out ({error})"));
    let mut peer = started.ok().map(|(peer, hello)| {
        println!("peer: {}", hello.trim());
        peer
    });
    let (mut our_secs, mut peer_secs) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        let start = Instant::now();
        let score = ours()?;
        our_secs.push(start.elapsed().as_secs_f64());
        if let Some(peer) = &mut peer {
            let reply = peer.ask(task)?;
            let (secs, theirs) = reply.trim().split_once(' ').ok_or("unreadable reply")?;
            let (secs, theirs): (f64, f64) = (secs.parse()?, theirs.parse()?);
            if (score - theirs).abs() > 1e-3 {
                return Err(format!("the two sides score differently: {score} and {theirs}").into());
            }
            peer_secs.push(secs);
        }
    }
    println!("  rprae {:9.2} ms", 1e3 * median(&mut our_secs.clone()));
    if !peer_secs.is_empty() {
        let mut ratios: Vec<f64> =
            peer_secs.iter().zip(&our_secs).map(|(theirs, ours)| theirs / ours).collect();
        println!("  peer  {:9.2} ms", 1e3 * median(&mut peer_secs));
        println!("  ratio {:9.2}x, median over {rounds} alternating rounds", median(&mut ratios));
    }
    Ok(())
}

fn bert_score_f(encoder: &Encoder, corpus: &Corpus) -> Result<f64, Box<dyn Error>> {
    let sentences: Vec<&str> = corpus.sentences().collect();
    let vectors = encoder.token_vectors(&sentences, false)?;
    let mut next = vectors.iter();
    let segments = corpus
        .segments()
        .iter()
        .map(|segment| {
            let hypothesis = next.next().ok_or("no vectors")?;
            let references = next.by_ref().take(segment.references.len()).map(|tokens| &**tokens).collect();
            Ok(EmbeddedSegment { hypothesis, references })
        })
        .collect::<Result<Vec<_>, Box<dyn Error>>>()?;
    let [.., f] = BertScore::default().measure(&segments);
    Ok(f.score())
}

/// Captions of six to some fifteen words with one to three references each, many of them equal, as in motion data.
fn captions(num: usize) -> Result<Corpus, Box<dyn Error>> {
    const WHO: [&str; 6] = ["a person", "someone", "a human", "the subject", "a man", "a woman"];
    const WHAT: [&str; 12] = [
        "walks forward",
        "turns around",
        "waves with the right hand",
        "jumps up",
        "kneels down on the floor",
        "runs in a circle",
        "picks something up",
        "throws a ball",
        "wipes a table",
        "plays the guitar",
        "kicks with the left leg",
        "stumbles over an obstacle",
    ];
    const HOW: [&str; 8] =
        ["slowly", "twice", "and then stops", "very fast", "carefully", "to the left", "again", ""];
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut draw = |limit: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % limit as u64) as usize
    };
    let mut sentence = || {
        let mut text = format!("{} {} {}", WHO[draw(6)], WHAT[draw(12)], HOW[draw(8)]);
        if draw(3) == 0 {
            let _ = write!(text, ", then {} {}", WHAT[draw(12)], HOW[draw(8)]);
        }
        format!("{}.", text.trim_end())
    };
    let segments = (0..num)
        .map(|index| Segment {
            id: index.to_string(),
            hypothesis: sentence(),
            references: (0..=(index % 3)).map(|_| sentence()).collect(),
        })
        .collect();
    Ok(Corpus::new(segments)?)
}

fn write_pairs(folder: &Path, corpus: &Corpus) -> Result<PathBuf, Box<dyn Error>> {
    let path = folder.join(format!("{}.jsonl", corpus.len()));
    let mut text = String::new();
    for segment in corpus.segments() {
        let pair = serde_json::json!({"hypothesis": segment.hypothesis, "references": segment.references});
        let _ = writeln!(text, "{pair}");
    }
    std::fs::write(&path, text)?;
    Ok(path)
}
