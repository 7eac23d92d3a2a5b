//! Vectors of words the model was not trained on.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::Context as _;

use crate::cli::progress::Counter;
use crate::dataset::WordVectors;
use crate::translation::Translator;

/// Memory for vectors that are kept between lines, bytes: all of a small file, the 700,000 most frequent words of a large one.
const MOST_BYTES: usize = 1 << 30;

/// A file of word vectors, and what has been taken from it.
pub(super) struct Vectors<'a> {
    path: &'a Path,
    quiet: bool,
    /// Its first words, once lines were asked for.
    kept: Option<WordVectors>,
    /// Words that were looked up, found or not.
    asked: BTreeSet<String>,
}

impl<'a> Vectors<'a> {
    pub fn new(path: &'a Path, quiet: bool) -> Self {
        Self { path, quiet, kept: None, asked: BTreeSet::new() }
    }

    /// Gives a translator the vectors of words of some sentences that it does not know, in one pass over the file.
    pub fn look_up<'c>(
        &mut self,
        translator: &mut Translator,
        captions: impl IntoIterator<Item = &'c str>,
    ) -> anyhow::Result<()> {
        // A file that is not there is told even where every word is known.
        std::fs::metadata(self.path)
            .with_context(|| format!("read the word vectors {}", self.path.display()))?;
        let unknown = self.new_words(translator, captions);
        self.scan(translator, &unknown)?;
        self.asked.extend(unknown);
        Ok(())
    }

    /// The same where sentences come one after the other: the file is read once and kept as far as memory is allowed, so
    /// that only a word beyond that costs another pass, and each such word only one.
    pub fn look_up_line(&mut self, translator: &mut Translator, line: &str) -> anyhow::Result<()> {
        let mut unknown = self.new_words(translator, [line]);
        if unknown.is_empty() {
            return Ok(());
        }
        let asked = unknown.clone();
        if self.kept.is_none() {
            let read = self.watched(|progress| WordVectors::read_first(self.path, MOST_BYTES, progress))?;
            self.kept = Some(read);
        }
        let Some(kept) = &self.kept else { return Ok(()) };
        let found: BTreeMap<String, Vec<f32>> =
            unknown.iter().filter_map(|word| Some((word.clone(), kept.vectors.get(word)?.clone()))).collect();
        unknown.retain(|word| !found.contains_key(word));
        let is_whole = kept.vectors.len() as u64 >= kept.num_words;
        let taken = WordVectors { dimensions: kept.dimensions, vectors: found, ..WordVectors::default() };
        translator.add_vectors(taken)?;
        if !is_whole {
            self.scan(translator, &unknown)?;
        }
        self.asked.extend(asked);
        Ok(())
    }

    /// Words that are neither known nor looked up yet.
    fn new_words<'c>(
        &self,
        translator: &Translator,
        captions: impl IntoIterator<Item = &'c str>,
    ) -> BTreeSet<String> {
        let mut unknown = translator.unknown_words(captions);
        unknown.retain(|word| !self.asked.contains(word));
        unknown
    }

    fn scan(&self, translator: &mut Translator, words: &BTreeSet<String>) -> anyhow::Result<()> {
        if words.is_empty() {
            return Ok(());
        }
        let vectors = self.watched(|progress| WordVectors::read(self.path, words, progress))?;
        Ok(translator.add_vectors(vectors)?)
    }

    fn watched<E>(
        &self,
        read: impl FnOnce(&dyn Fn(f64)) -> Result<WordVectors, E>,
    ) -> Result<WordVectors, E> {
        let counter = Counter::new(self.quiet);
        let read = read(&|share| counter.show("word vectors", (100.0 * share) as usize, 100));
        counter.finish();
        for warning in read.iter().flat_map(|vectors| &vectors.warnings) {
            eprintln!("{}: {warning}", self.path.display());
        }
        read
    }
}
