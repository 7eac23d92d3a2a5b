//! Word vectors in every layout, sound and lying.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;
use std::path::Path;

use rprae::dataset::{VectorError, WordVectors};

fn wanted(words: &[&str]) -> BTreeSet<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

fn read(folder: &Path, bytes: &[u8], words: &[&str]) -> Result<WordVectors, VectorError> {
    let path = folder.join("vectors");
    std::fs::write(&path, bytes).unwrap();
    WordVectors::read(&path, &wanted(words), &|_| {})
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

const WORDS: [(&str, [f32; 3]); 3] =
    [("walk", [0.5, -0.25, 1.0]), ("New_York", [1.0, 2.0, 3.0]), ("läuft", [-1.5, 0.0, 8.0])];

fn binary(header: &str, end: &[u8]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    for (word, vector) in WORDS {
        bytes.extend(word.as_bytes());
        bytes.push(b' ');
        bytes.extend(vector.iter().flat_map(|value| value.to_le_bytes()));
        bytes.extend(end);
    }
    bytes
}

fn text(header: &str) -> String {
    let lines: Vec<String> = WORDS.iter().map(|(word, [a, b, c])| format!("{word} {a} {b} {c}\n")).collect();
    format!("{header}{}", lines.concat())
}

#[test]
fn the_first_words_are_kept_as_far_as_memory_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vectors");
    for bytes in [binary("3 3\n", b""), text("").into_bytes()] {
        std::fs::write(&path, bytes).unwrap();
        let all = WordVectors::read_first(&path, 1 << 20, &|_| {}).unwrap();
        assert_eq!((all.vectors.len(), all.num_words), (3, 3));
        // Enough for two of three.
        let some = WordVectors::read_first(&path, 300, &|_| {}).unwrap();
        assert_eq!(some.vectors.keys().collect::<Vec<_>>(), ["New_York", "walk"]);
        assert_eq!(some.num_words, 3);
        assert_eq!(WordVectors::read_first(&path, 0, &|_| {}).unwrap().vectors.len(), 0);
    }
}

#[test]
fn every_layout_gives_the_same_vectors() {
    let folder = tempfile::tempdir().unwrap();
    let files: [Vec<u8>; 6] = [
        binary("3 3\n", b""),
        binary("3 3\n", b"\n"),
        gzip(&binary("3 3\n", b"")),
        text("3 3\n").into_bytes(),
        text("").replace('\n', " \r\n").into_bytes(),
        gzip(text("").as_bytes()),
    ];
    for (index, file) in files.iter().enumerate() {
        let read = read(folder.path(), file, &["walk", "läuft", "new_york", "absent"]).unwrap();
        assert_eq!((read.dimensions, read.num_words), (3, 3), "file {index}");
        assert_eq!(read.warnings, [""; 0], "file {index}");
        let expected: BTreeMap<String, Vec<f32>> =
            [&WORDS[0], &WORDS[2]].map(|(word, vector)| ((*word).to_owned(), vector.to_vec())).into();
        assert_eq!(read.vectors, expected, "file {index}");
    }
}

#[test]
fn words_may_hold_spaces_and_the_first_of_a_repeated_word_holds() {
    let folder = tempfile::tempdir().unwrap();
    let file = "the 1 2\n. . . 3 4\nthe 5 6\nat x@y 7 8\n";
    let read = read(folder.path(), file.as_bytes(), &["the", ". . .", "at x@y"]).unwrap();
    assert_eq!(read.vectors["the"], [1.0, 2.0]);
    assert_eq!(read.vectors[". . ."], [3.0, 4.0]);
    assert_eq!(read.vectors["at x@y"], [7.0, 8.0]);
}

#[test]
fn headers_that_lie_are_found_out() {
    let folder = tempfile::tempdir().unwrap();
    let long: Vec<u8> = {
        let mut bytes = b"2000 300\n".to_vec();
        for index in 0..2000_u32 {
            bytes.extend(format!("word{index} ").as_bytes());
            let value = 0.001 * index as f32 - 1.0;
            bytes.extend((0..300).flat_map(|i| (value + 0.0003 * i as f32).to_le_bytes()));
        }
        bytes
    };
    let with_header = |header: &str| {
        let mut bytes = header.as_bytes().to_vec();
        bytes.extend(&long[b"2000 300\n".len()..]);
        bytes
    };
    assert_eq!(read(folder.path(), &long, &["word7"]).unwrap().vectors.len(), 1);

    // More words than there are: what is there is kept, and said.
    let more = read(folder.path(), &with_header("3000000 300\n"), &["word7"]).unwrap();
    assert_eq!((more.vectors.len(), more.num_words), (1, 2000));
    assert!(more.warnings[0].contains("the file ends after 2000: it is truncated"), "{:?}", more.warnings);
    let cut = read(folder.path(), &long[..long.len() - 5], &["word7", "word1999"]).unwrap();
    assert_eq!((cut.vectors.len(), cut.num_words), (1, 1999));
    let fewer = read(folder.path(), &with_header("5 300\n"), &["word4", "word7"]).unwrap();
    assert_eq!(fewer.vectors.len(), 1);
    assert!(fewer.warnings[0].contains("more data follows the 5 words"), "{:?}", fewer.warnings);
    let text = read(folder.path(), text("9 3\n").as_bytes(), &["walk"]).unwrap();
    assert_eq!(text.warnings, ["the header announces 9 words, the file has 3"]);

    for (file, reason) in [
        (with_header("2000 299\n"), "do not fit the file"),
        (with_header("2000 50\n"), "do not fit the file"),
        (with_header("2000 5000\n"), "at most"),
        (with_header("99999999999 300\n"), "at most"),
        (with_header("2000 0\n"), "at most"),
        (Vec::new(), "the file is empty"),
        (b"hello world".to_vec(), "line 1 is neither"),
        (b"PK\x03\x04".repeat(100), "line 1 is neither"),
        (vec![b'x'; 1 << 20], "line 1 is neither"),
        (format!("a 1 2\n{}", "b 1\n".repeat(100)).into_bytes(), "expected a word and 2 numbers"),
        (gzip(&vec![b' '; 64 << 20]), "line 1 is neither"),
    ] {
        let error = read(folder.path(), &file, &["word7"]).expect_err(reason).to_string();
        assert!(error.contains(reason) && !error.contains('\n'), "{error} should contain {reason}");
    }
    // 120 MB of zeros behind a sound beginning.
    let mut bomb = b"9000000 300\n".to_vec();
    let entry = [&b"word "[..], &[0; 1200]].concat();
    (0..100_000).for_each(|_| bomb.extend(&entry));
    let error = read(folder.path(), &gzip(&bomb), &["x"]).unwrap_err().to_string();
    assert!(error.contains("compressed more than 200:1"), "{error}");
}

#[test]
fn numbers_that_are_not_finite_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let read = read(folder.path(), b"a 1 2\nb nan 2\nc 3 inf\nd 5 6\n", &["a", "b", "c", "d"]).unwrap();
    assert_eq!(read.vectors.keys().collect::<Vec<_>>(), ["a", "d"]);
    assert!(read.warnings[0].contains("left out: 2, the first is line 2"), "{:?}", read.warnings);
}

#[test]
fn coverage_names_the_most_frequent_missing_words() {
    let folder = tempfile::tempdir().unwrap();
    let vectors = read(folder.path(), text("").as_bytes(), &["walk", "a", "of"]).unwrap();
    let occurrences = [("walk", 5), ("of", 2), ("a", 7), ("zeal", 2)].map(|(w, n)| (w.to_owned(), n)).into();
    let coverage = vectors.coverage(&occurrences);
    assert_eq!((coverage.num_words, coverage.num_covered), (4, 1));
    assert_eq!((coverage.num_tokens, coverage.num_covered_tokens), (16, 5));
    let missing: Vec<&str> = coverage.missing.iter().map(|(word, _)| word.as_str()).collect();
    assert_eq!(missing, ["a", "of", "zeal"]);
}

#[test]
fn the_published_vectors_load() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA is not set, so there are no published vectors to read");
        return;
    };
    let path = Path::new(&data).join("word-vectors/googlenews-subset-31k.bin");
    let read = WordVectors::read(&path, &wanted(&["in", "walk", "a", "of"]), &|_| {}).unwrap();
    assert_eq!((read.num_words, read.dimensions), (31_530, 300));
    assert!(read.warnings.is_empty(), "{:?}", read.warnings);
    assert_eq!(read.vectors.keys().collect::<Vec<_>>(), ["in", "walk"]);
    assert_eq!(read.vectors["in"][..3], [0.0703125, 0.086_914_06, 0.087890625]);
}
