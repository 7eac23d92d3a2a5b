//! What a reader should know about a case beyond its numbers.

use super::case::{CaseResult, LevelResult};
use super::number::{compact, counted};
use crate::plausibility::PropSupport;

/// Kind of a note, worst first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoteKind {
    /// The case failed and has no numbers at some level.
    Failed,
    /// Something other than the floor held the body, so levels 1 to 3 say nothing about the motion.
    NotSimulable,
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

/// Notes on a case, worst first: failures, supports other than the floor (then no falls), scores beyond [what a body can do](NoteKind::Implausible), falls, warnings.
///
/// Implausible are a float above 30 mm, a slowest contact above 150 mm/s, a root faster than 12.5 m/s, and a force that
/// contacts cannot explain above 20 % of body weight.
#[must_use]
pub fn notes(case: &CaseResult) -> Vec<Note> {
    let note = |kind, text| Note { kind, text };
    let mut notes: Vec<Note> =
        case.failures.iter().map(|reason| note(NoteKind::Failed, format!("FAILED: {reason}"))).collect();
    let held: Vec<String> = case.props.iter().map(held).collect();
    if !held.is_empty() {
        notes.push(note(NoteKind::NotSimulable, format!("NOT SIMULABLE: {}", held.join(", "))));
    }
    let beyond: Vec<String> = LIMITS
        .iter()
        .filter(|(key, ..)| case.simulable() || key.starts_with("l0/"))
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
        .filter(|_| case.simulable())
        .filter_map(|level| Some(format!("{} {:.1} s", level.level, fall_secs(level)?)))
        .collect();
    if !falls.is_empty() {
        notes.push(note(NoteKind::Fell, format!("fell: {}", falls.join(", "))));
    }
    match case.warnings.len() + case.doubts().count() {
        0 => {}
        count => notes.push(note(NoteKind::Doubt, counted(count, "warning"))),
    }
    notes
}

/// What held the body, and when.
pub(super) fn held(support: &PropSupport) -> String {
    format!("{} {:.1}-{:.1} s", support.prop.word(), support.from_secs, support.to_secs)
}

/// Everything that is known of a case in words: when or where, and what. Warnings first, then doubts about what is read back,
/// then events by level.
pub(super) fn remarks(case: &CaseResult) -> Vec<(String, String)> {
    let warnings = case.warnings.iter().map(|warning| ("input".to_owned(), warning.clone()));
    let doubts = case.doubts().map(|(level, doubt)| (format!("{level} read back"), doubt.to_owned()));
    let events = case.levels.iter().flat_map(|level| {
        level
            .events
            .iter()
            .map(|event| (format!("{} {:.2} s", level.level, event.time_secs), event.message.clone()))
    });
    warnings.chain(doubts).chain(events).collect()
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
        let level = walk.levels[0].level;
        walk.levels[0].read_back_doubts.push("it lasts 9 s".to_owned());
        assert_eq!(notes(&walk).last().unwrap().text, "2 warnings");
        assert!(remarks(&walk).contains(&(format!("{level} read back"), "it lasts 9 s".to_owned())));
    }

    #[test]
    fn a_motion_held_by_something_is_not_blamed_for_falling() {
        let mut sit =
            case("sit", &[("l3/survived", 0.0), ("l3/time_to_fall", 1.26), ("l1/residual_force", 40.0)]);
        let prop = crate::plausibility::Prop::Seat;
        sit.props =
            vec![PropSupport { prop, from_secs: 1.0, to_secs: 2.5, unexplained_bw: 0.4, explained: 0.9 }];
        let texts: Vec<String> = notes(&sit).into_iter().map(|note| note.text).collect();
        assert_eq!(texts, ["NOT SIMULABLE: seat 1.0-2.5 s"]);
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
