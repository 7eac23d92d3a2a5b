//! The URDF as a viewer should get it.
//!
//! Viewers draw collision shapes on top of the visual ones, and the two coincide here, so the collision shapes are left
//! out; the whole URDF is attached to the recording.
//! The reference is a second robot: the same links under prefixed names, pale and see-through where a viewer can.

use quick_xml::events::attributes::{AttrError, Attribute};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, Writer};

use super::frames::REFERENCE_PREFIX;

/// Colour of every part of the reference, red, green, blue and opacity.
const REFERENCE_RGBA: &str = "0.55 0.80 0.60 0.35";

/// Which of the two robots of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Actor {
    /// The body that was simulated.
    Simulated,
    /// The pose it was told to take.
    Reference,
}

/// URDF text to show `actor`, from the URDF of the humanoid.
///
/// # Errors
/// The text is not well-formed XML.
pub(super) fn viewer_urdf(urdf: &str, actor: Actor) -> Result<String, quick_xml::Error> {
    let mut reader = Reader::from_str(urdf);
    let mut writer = Writer::new(Vec::new());
    // Depth inside an element that is left out.
    let mut skipped_depth = 0_usize;
    loop {
        let event = reader.read_event()?;
        let leaves_out = |element: &BytesStart<'_>| match element.name().as_ref() {
            "collision" => true,
            "inertial" => actor == Actor::Reference,
            _ => false,
        };
        match event {
            Event::Eof => break,
            Event::Start(_) if skipped_depth > 0 => skipped_depth += 1,
            Event::End(_) if skipped_depth > 0 => skipped_depth -= 1,
            _ if skipped_depth > 0 => {}
            Event::Start(ref element) if leaves_out(element) => skipped_depth = 1,
            Event::Empty(ref element) if leaves_out(element) => {}
            Event::Start(element) => writer.write_event(Event::Start(renamed(&element, actor)?))?,
            Event::Empty(element) => writer.write_event(Event::Empty(renamed(&element, actor)?))?,
            // Space between elements is all the text a URDF has.
            Event::Text(_) | Event::Comment(_) => {}
            other => writer.write_event(other)?,
        }
    }
    Ok(String::from_utf8_lossy(&writer.into_inner()).into_owned())
}

/// The element with the attributes the actor needs.
fn renamed<'a>(element: &BytesStart<'a>, actor: Actor) -> Result<BytesStart<'a>, AttrError> {
    if actor == Actor::Simulated {
        return Ok(element.clone());
    }
    let tag = element.name();
    let mut changed = element.clone();
    changed.clear_attributes();
    for attribute in element.attributes() {
        let Attribute { key, value } = attribute?;
        // Attribute values stay escaped as they are; what is put before or after them needs no escaping.
        let value = match (tag.as_ref(), key.as_ref()) {
            ("link", "name") | ("parent" | "child", "link") => format!("{REFERENCE_PREFIX}{value}").into(),
            ("robot", "name") => format!("{value}_reference").into(),
            ("color", "rgba") => REFERENCE_RGBA.into(),
            _ => value,
        };
        changed.push_attribute(Attribute { key, value });
    }
    Ok(changed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::humanoid::Humanoid;
    use crate::motion::Body;
    use crate::robot::parse_urdf;

    #[test]
    fn both_robots_have_the_tree_of_the_humanoid() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.6)).unwrap();
        for (actor, prefix) in [(Actor::Simulated, ""), (Actor::Reference, "reference/")] {
            let text = viewer_urdf(&humanoid.urdf, actor).unwrap();
            let robot = parse_urdf(&text).unwrap();
            let (ours, original) = (&robot.tree, &humanoid.robot.tree);
            assert_eq!(ours.links().len(), original.links().len());
            for (link, expected) in ours.links().iter().zip(original.links()) {
                assert_eq!(link.name, format!("{prefix}{}", expected.name));
            }
            assert_eq!(ours.joints(), original.joints());
            assert!(robot.collisions.iter().all(Vec::is_empty));
            assert_eq!(text.matches("<visual").count(), humanoid.urdf.matches("<visual").count());
        }
    }

    #[test]
    fn the_reference_has_another_name_and_one_pale_colour() {
        let urdf = "<robot name=\"a\"><material name=\"m\"><color rgba=\"1 0 0 1\"/></material>\
                    <link name=\"l\"/></robot>";
        let text = viewer_urdf(urdf, Actor::Reference).unwrap();
        assert_eq!(
            text,
            format!(
                "<robot name=\"a_reference\"><material name=\"m\"><color rgba=\"{REFERENCE_RGBA}\"/></material>\
                 <link name=\"reference/l\"/></robot>"
            )
        );
    }
}
