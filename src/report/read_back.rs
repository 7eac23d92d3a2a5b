//! What a model says the motions of a run are.

use super::results::Results;
use crate::simulation::Level;

/// A case that a model has read.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReadBackRow<'a> {
    id: &'a str,
    caption: &'a str,
    given: Option<&'a str>,
    performed: Option<&'a str>,
}

impl<'a> ReadBackRow<'a> {
    /// Id, caption, and what is read back from the motion as it was given and as it was performed; a dash for nothing.
    pub fn cells(self) -> [&'a str; 4] {
        [self.id, self.caption, self.given.unwrap_or("-"), self.performed.unwrap_or("-")]
    }
}

/// Cases that a model has read, by id; none when no model was in the loop.
pub(super) fn read_back_rows(results: &Results) -> impl Iterator<Item = ReadBackRow<'_>> {
    results.cases.iter().filter_map(|case| {
        let (given, performed) = (case.read_back(Level::L0), case.read_back(Level::L2));
        (given.is_some() || performed.is_some()).then_some(ReadBackRow {
            id: &case.id,
            caption: case.caption(),
            given,
            performed,
        })
    })
}
