//! What a reader should know about a case beyond its numbers.

use super::case::{CaseResult, LevelResult};
use super::number::compact;

/// Kind of a note, worst first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoteKind {
    /// The case failed and has no numbers at some level.
    Failed,
    /// A kinematic or dynamic score is beyond what a body can do; see [`notes`].
    Implausible,
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

/// What a body cannot do: metric, the value beyond which it is remarked on, how to say it, and the unit.
///
/// - Float: the ground shift before a simulation hides up to 30 mm, so more is not an offset of the floor.
/// - Slowest contact: in 23 recorded motions (KIT) it is at most 58 mm/s, so beyond 150 mm/s no part of the foot rests.
/// - Root speed: the fastest sprinters reach 12.4 m/s.
/// - Residual force: in the same recordings it is at most 4.3 % of body weight, in pushes against a person.
const LIMITS: [(&str, f64, &str, &str); 4] = [
    ("l0/float", 30.0, "floats", "mm"),
    ("l0/slowest_contact_speed", 150.0, "slides", "mm/s"),
    ("l0/root_speed_peak", 12.5, "moves at", "m/s"),
    ("l1/residual_force", 20.0, "unexplained", "% BW"),
];

/// Notes on a case, worst first: failures, scores beyond [what a body can do](NoteKind::Implausible), falls, warnings.
///
/// Implausible are a float above 30 mm, a slowest contact above 150 mm/s, a root faster than 12.5 m/s, and a force that
/// contacts cannot explain above 20 % of body weight.
#[must_use]
pub fn notes(case: &CaseResult) -> Vec<Note> {
    let note = |kind, text| Note { kind, text };
    let mut notes: Vec<Note> =
        case.failures.iter().map(|reason| note(NoteKind::Failed, format!("FAILED: {reason}"))).collect();
    let beyond: Vec<String> = LIMITS
        .iter()
        .filter_map(|(key, limit, word, unit)| {
            let value = case.score(key).filter(|value| value > limit)?;
            Some(format!("{word} {} {unit}", compact(value)))
        })
        .collect();
    if !beyond.is_empty() {
        notes.push(note(NoteKind::Implausible, format!("IMPLAUSIBLE: {}", beyond.join(", "))));
    }
    let falls: Vec<String> = case
        .levels
        .iter()
        .filter_map(|level| Some(format!("{} {:.1} s", level.level, fall_secs(level)?)))
        .collect();
    if !falls.is_empty() {
        notes.push(note(NoteKind::Fell, format!("fell: {}", falls.join(", "))));
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
        assert_eq!(texts, ["FAILED: L2: not a number at 0.5 s", "fell: L3 1.3 s", "1 warning"]);
    }

    #[test]
    fn only_what_no_body_does_is_called_implausible() {
        assert_eq!(notes(&case("walk", &[("l0/float", 29.0), ("l0/root_speed_peak", 12.0)])), []);
        let floating = case("float", &[("l0/float", 100.0), ("l0/slowest_contact_speed", 250.0)]);
        let expected = "IMPLAUSIBLE: floats 100 mm, slides 250 mm/s".to_owned();
        assert_eq!(notes(&floating), [Note { kind: NoteKind::Implausible, text: expected }]);
        for (key, _, _, unit) in LIMITS {
            let metric = crate::plausibility::find_metric(key).unwrap();
            assert_eq!((metric.unit, metric.better), (unit, crate::plausibility::Better::Lower), "{key}");
        }
    }
}
