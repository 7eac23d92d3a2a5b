//! What a reader should know about a case beyond its numbers.

use super::case::{CaseResult, LevelResult};

/// Kind of a note, worst first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoteKind {
    /// The case failed and has no numbers at some level.
    Failed,
    /// The body fell in the simulation, which is a result.
    Fell,
    /// A doubt about the input.
    Doubt,
}

/// A short remark on a case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Kind.
    pub kind: NoteKind,
    /// A few words without a full stop.
    pub text: String,
}

/// Notes on a case, worst first.
#[must_use]
pub fn notes(case: &CaseResult) -> Vec<Note> {
    let note = |kind, text| Note { kind, text };
    let mut notes: Vec<Note> =
        case.failures.iter().map(|reason| note(NoteKind::Failed, format!("FAILED: {reason}"))).collect();
    for level in &case.levels {
        if let Some(secs) = fall_secs(level) {
            notes.push(note(NoteKind::Fell, format!("{} fell at {secs:.1} s", level.level)));
        }
    }
    match case.warnings.len() {
        0 => {}
        1 => notes.push(note(NoteKind::Doubt, "1 warning".to_owned())),
        count => notes.push(note(NoteKind::Doubt, format!("{count} warnings"))),
    }
    notes
}

/// Everything that is known of a case in words: when or where, and what. Warnings first, then events by level.
pub(super) fn remarks(case: &CaseResult) -> Vec<(String, String)> {
    let warnings = case.warnings.iter().map(|warning| ("input".to_owned(), warning.clone()));
    let events = case.levels.iter().flat_map(|level| {
        level
            .events
            .iter()
            .map(|event| (format!("{} {:.2} s", level.level, event.time_secs), event.message.clone()))
    });
    warnings.chain(events).collect()
}

/// Time of the fall as the scores tell it, so that the note and the number beside it cannot disagree.
fn fall_secs(level: &LevelResult) -> Option<f64> {
    let prefix = level.level.to_string().to_lowercase();
    let score = |name: &str| level.scores.get(&format!("{prefix}/{name}")).copied();
    if score("survived")? == 0.0 { score("time_to_fall") } else { None }
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::*;

    #[test]
    fn failures_come_first_and_falls_say_when() {
        let fall = [("l3/survived", 0.0), ("l3/time_to_fall", 1.26)];
        let mut walk = case("walk", &[("l2/survived", 1.0), ("l2/time_to_fall", 2.0)]);
        assert_eq!(notes(&walk), []);
        walk.warnings.push("the mass is a placeholder".to_owned());
        walk.levels.extend(case("walk", &fall).levels);
        walk.failures.push("L2: not a number at 0.5 s".to_owned());
        let texts: Vec<String> = notes(&walk).into_iter().map(|note| note.text).collect();
        assert_eq!(texts, ["FAILED: L2: not a number at 0.5 s", "L3 fell at 1.3 s", "1 warning"]);
    }
}
