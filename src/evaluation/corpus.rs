//! What is scored: hypotheses, each with its references.

use thiserror::Error;

/// Longest sentence in bytes; a caption has some hundred, and the cost of some scores grows with the square.
pub const MAX_SENTENCE_BYTES: usize = 10_000;
/// Most references of one hypothesis.
pub const MAX_REFERENCES: usize = 1_000;

/// One hypothesis and the references it is compared with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Segment {
    /// What names the segment in results, for example the id of a motion.
    pub id: String,
    /// The sentence to be scored.
    pub hypothesis: String,
    /// Sentences that would have been right; one at least.
    pub references: Vec<String>,
}

/// Segments that can be scored: at least one, each with a reference, no sentence without end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Corpus {
    segments: Vec<Segment>,
}

/// Why segments cannot be scored.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum CorpusError {
    /// Nothing to score.
    #[error("find anything to score: there is no segment")]
    Empty,
    /// A segment without references.
    #[error("score segment {id:?}: it has no reference")]
    NoReference {
        /// Id of the segment.
        id: String,
    },
    /// A segment with too many references.
    #[error("score segment {id:?}: it has {found} references and at most {MAX_REFERENCES} are taken")]
    TooManyReferences {
        /// Id of the segment.
        id: String,
        /// Number of references.
        found: usize,
    },
    /// A sentence that is too long to be one.
    #[error("score segment {id:?}: a sentence of {found} bytes, and at most {MAX_SENTENCE_BYTES} are taken")]
    TooLong {
        /// Id of the segment.
        id: String,
        /// Length in bytes.
        found: usize,
    },
}

impl Corpus {
    /// Checks segments.
    ///
    /// # Errors
    /// A [`CorpusError`] that names the first segment at fault.
    pub fn new(segments: Vec<Segment>) -> Result<Self, CorpusError> {
        if segments.is_empty() {
            return Err(CorpusError::Empty);
        }
        for segment in &segments {
            let id = || segment.id.clone();
            if segment.references.is_empty() {
                return Err(CorpusError::NoReference { id: id() });
            }
            if segment.references.len() > MAX_REFERENCES {
                return Err(CorpusError::TooManyReferences { id: id(), found: segment.references.len() });
            }
            let mut sentences = std::iter::once(&segment.hypothesis).chain(&segment.references);
            if let Some(sentence) = sentences.find(|sentence| sentence.len() > MAX_SENTENCE_BYTES) {
                return Err(CorpusError::TooLong { id: id(), found: sentence.len() });
            }
        }
        Ok(Self { segments })
    }

    /// The segments in the order given.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Number of segments.
    #[must_use]
    pub fn len(&self) -> usize {
        self.segments.len()
    }

    /// Always false: a corpus has segments.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// All references of all segments, in order.
    pub fn references(&self) -> impl Iterator<Item = &str> {
        self.segments.iter().flat_map(|segment| segment.references.iter().map(String::as_str))
    }

    /// Every sentence, hypotheses and references, in order and with repetitions.
    pub fn sentences(&self) -> impl Iterator<Item = &str> {
        self.segments.iter().flat_map(|segment| {
            std::iter::once(segment.hypothesis.as_str()).chain(segment.references.iter().map(String::as_str))
        })
    }

    /// Number of references of every segment for a signature, or `var` when segments differ.
    #[must_use]
    pub fn num_references(&self) -> String {
        let first = self.segments[0].references.len();
        let equal = self.segments.iter().all(|segment| segment.references.len() == first);
        if equal { first.to_string() } else { "var".to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(references: &[&str]) -> Segment {
        Segment {
            id: "7".to_owned(),
            hypothesis: "a person walks".to_owned(),
            references: references.iter().map(|&text| text.to_owned()).collect(),
        }
    }

    #[test]
    fn what_cannot_be_scored_is_named() {
        assert_eq!(Corpus::new(vec![]), Err(CorpusError::Empty));
        assert_eq!(Corpus::new(vec![segment(&[])]), Err(CorpusError::NoReference { id: "7".to_owned() }));
        let long = "a".repeat(MAX_SENTENCE_BYTES + 1);
        assert!(matches!(Corpus::new(vec![segment(&[&long])]), Err(CorpusError::TooLong { .. })));
        let many = vec!["a"; MAX_REFERENCES + 1];
        assert!(matches!(Corpus::new(vec![segment(&many)]), Err(CorpusError::TooManyReferences { .. })));
    }

    #[test]
    fn the_number_of_references_is_told() {
        let count = |segments| Corpus::new(segments).unwrap().num_references();
        assert_eq!(count(vec![segment(&["a", "b"]), segment(&["c", "d"])]), "2");
        assert_eq!(count(vec![segment(&["a", "b"]), segment(&["c"])]), "var");
    }
}
