//! XML text as a bounded list of elements.
//!
//! What a file can do to us is limited here: its size, depth and number of elements, and no document type (so no
//! entities that expand).

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

use super::RobotError;

/// Largest text accepted, bytes.
const MAX_BYTES: usize = 16 << 20;
/// Deepest nesting of elements accepted.
const MAX_DEPTH: usize = 32;
/// Largest number of elements accepted.
const MAX_ELEMENTS: usize = 200_000;

/// An element with its attributes and the indices of its children in the [`Document`].
#[derive(Debug)]
pub(super) struct Element {
    /// Tag, with its prefix if it has one.
    pub tag: String,
    /// Line of the text it starts on, from one.
    pub line: usize,
    attributes: Vec<(String, String)>,
    children: Vec<usize>,
}

impl Element {
    /// Value of an attribute.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

/// The elements of a text, each after its parent; text between tags, comments and instructions are left out.
#[derive(Debug)]
pub(super) struct Document {
    elements: Vec<Element>,
}

impl Document {
    /// Reads a text that is one element with its children.
    pub(super) fn parse(text: &str) -> Result<Self, RobotError> {
        if text.len() > MAX_BYTES {
            return Err(RobotError::TooLarge { found: text.len(), limit: MAX_BYTES });
        }
        let mut reader = quick_xml::Reader::from_str(text);
        let mut lines = LineCounter { text, position: 0, line: 1 };
        let mut elements: Vec<Element> = Vec::new();
        let mut open: Vec<usize> = Vec::new();
        loop {
            let line = lines.at(reader.buffer_position());
            let fault = |reason: &str| RobotError::Xml { line, reason: reason.to_owned() };
            let event = reader.read_event().map_err(|error| fault(&error.to_string()))?;
            let (tag, opens) = match &event {
                Event::Start(tag) => (tag, true),
                Event::Empty(tag) => (tag, false),
                // The reader has checked that it closes the innermost element.
                Event::End(_) => {
                    open.pop();
                    continue;
                }
                Event::DocType(_) => return Err(fault("a document type declaration is not accepted")),
                Event::Eof if !open.is_empty() => return Err(fault("the text ends inside an element")),
                Event::Eof if elements.is_empty() => return Err(fault("there is no element")),
                Event::Eof => return Ok(Self { elements }),
                _ => continue,
            };
            if elements.len() == MAX_ELEMENTS {
                return Err(fault("there are more than 200000 elements"));
            }
            if open.len() == MAX_DEPTH {
                return Err(fault("elements are nested more than 32 deep"));
            }
            let index = elements.len();
            match open.last() {
                Some(&parent) => elements[parent].children.push(index),
                None if index > 0 => return Err(fault("there is more than one outermost element")),
                None => {}
            }
            elements.push(element(tag, line).map_err(|error| fault(&error.to_string()))?);
            if opens {
                open.push(index);
            }
        }
    }

    /// The outermost element.
    pub(super) fn root(&self) -> &Element {
        // `parse` refuses a text without elements.
        &self.elements[0]
    }

    /// Children of an element, in order.
    pub(super) fn children<'a>(&'a self, element: &'a Element) -> impl Iterator<Item = &'a Element> {
        element.children.iter().map(|&child| &self.elements[child])
    }
}

fn element(tag: &BytesStart<'_>, line: usize) -> quick_xml::Result<Element> {
    let mut attributes = Vec::new();
    for attribute in tag.attributes() {
        let attribute = attribute?;
        let value = attribute.normalized_value(XmlVersion::Implicit1_0)?;
        attributes.push((attribute.key.as_ref().to_owned(), value.into_owned()));
    }
    Ok(Element { tag: tag.name().as_ref().to_owned(), line, attributes, children: Vec::new() })
}

/// Line numbers of ascending byte positions.
struct LineCounter<'a> {
    text: &'a str,
    position: usize,
    line: usize,
}

impl LineCounter<'_> {
    fn at(&mut self, position: u64) -> usize {
        let position =
            usize::try_from(position).map_or(self.text.len(), |position| position.min(self.text.len()));
        if let Some(passed) = self.text.get(self.position..position) {
            self.line += passed.matches('\n').count();
            self.position = position;
        }
        self.line
    }
}
