//! A pull reader for the subset of XML that motion files need: elements, attributes and text.
//!
//! No tree is built.
//! Nesting is bounded; document types, entities and CDATA are refused, so nothing expands.

use std::io::BufRead as _;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::numbers::{NotANumber, parse_numbers};
use super::{MmmError, MmmFault};
use crate::dataset::one_line;

/// Deepest accepted nesting of elements; MMM files need 8.
pub(super) const MAX_DEPTH: usize = 64;

/// What comes next inside an element.
pub(super) enum Node<'a> {
    /// A child element opens.
    Start(BytesStart<'a>),
    /// Text between markup.
    Text(&'a str),
    /// The element ends.
    End,
}

/// A child element that was asked for by name.
pub(super) struct NamedChild<'a> {
    /// Index of its name among those asked for.
    pub(super) index: usize,
    /// Its text, if it has been passed as a whole; otherwise the element is open.
    pub(super) content: Option<&'a [u8]>,
}

/// Position in an XML document.
pub(super) struct Cursor<'a> {
    document: &'a [u8],
    reader: Reader<&'a [u8]>,
    depth: usize,
    /// An element without content (`<a/>`) was opened and is yet to be closed.
    empty_open: bool,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(document: &'a [u8]) -> Self {
        let mut reader = Reader::from_reader(document);
        // White space between elements would be a third of all events.
        reader.config_mut().trim_text_start = true;
        Self { document, reader, depth: 0, empty_open: false }
    }

    /// Wraps a fault with the line the cursor is on.
    pub(super) fn fault(&self, fault: impl Into<MmmFault>) -> MmmError {
        let position = (self.reader.buffer_position() as usize).min(self.document.len());
        MmmError { line: line_of(self.document, position), fault: fault.into() }
    }

    /// Bytes of the document that have not been read.
    pub(super) fn remaining(&self) -> usize {
        self.reader.get_ref().len()
    }

    /// The root element, which must have this name.
    pub(super) fn root(&mut self, name: &'static str) -> Result<(), MmmError> {
        match self.next()? {
            Some(Node::Start(start)) if start.name().as_ref() == name => Ok(()),
            Some(Node::Start(start)) => {
                let found = one_line(start.name().as_ref());
                Err(self.fault(MmmFault::Root { found }))
            }
            Some(Node::Text(_) | Node::End) => Err(self.fault(MmmFault::NotXml)),
            None => Err(self.fault(MmmFault::NoRoot)),
        }
    }

    /// Reads the document to its end, which must hold nothing but white space and comments.
    pub(super) fn finish(&mut self) -> Result<(), MmmError> {
        match self.next()? {
            None => Ok(()),
            Some(_) => Err(self.fault(MmmFault::Trailing)),
        }
    }

    /// The next node within the element `inside`, whose start has been read.
    pub(super) fn child(&mut self, inside: &'static str) -> Result<Node<'a>, MmmError> {
        match self.next()? {
            Some(node) => Ok(node),
            None => Err(self.fault(MmmFault::Truncated { element: inside })),
        }
    }

    /// The next child element of `inside`, or `None` at its end; text between children is an error.
    pub(super) fn child_element(&mut self, inside: &'static str) -> Result<Option<BytesStart<'a>>, MmmError> {
        match self.child(inside)? {
            Node::Start(start) => Ok(Some(start)),
            Node::End => Ok(None),
            Node::Text(text) => {
                Err(self.fault(MmmFault::Text { element: inside, found: one_line(text.trim()) }))
            }
        }
    }

    /// The next child of `inside` that is one of `names`, or `None` at the end of `inside`.
    ///
    /// Children with other names are skipped.
    /// Where a child is as simple as `<Name>text</Name>`, it is passed as a whole; otherwise it is opened.
    pub(super) fn child_of(
        &mut self,
        inside: &'static str,
        names: &[&str],
    ) -> Result<Option<NamedChild<'a>>, MmmError> {
        loop {
            let index_of = |found: &[u8]| names.iter().position(|name| name.as_bytes() == found);
            if let Some((name, content)) = self.simple_child() {
                if let Some(index) = index_of(name) {
                    return Ok(Some(NamedChild { index, content: Some(content) }));
                }
                continue;
            }
            let Some(start) = self.child_element(inside)? else { return Ok(None) };
            match index_of(start.name().as_ref().as_bytes()) {
                Some(index) => return Ok(Some(NamedChild { index, content: None })),
                None => self.skip()?,
            }
        }
    }

    /// Passes a child without attributes and markup, and returns its name and content.
    ///
    /// Nearly all of a motion file is such elements, and as events each costs three scans of its text.
    /// Anything else is left where it is, to be read as events.
    fn simple_child(&mut self) -> Option<(&'a [u8], &'a [u8])> {
        if self.empty_open {
            return None;
        }
        let rest: &'a [u8] = self.reader.get_ref();
        let (_, element) = rest[rest.iter().position(|byte| !byte.is_ascii_whitespace())?..]
            .split_first_chunk::<1>()
            .filter(|(first, _)| **first == *b"<")?;
        let name = &element[..element.iter().position(|byte| !byte.is_ascii_alphanumeric())?];
        let content = element[name.len()..].strip_prefix(b">").filter(|_| !name.is_empty())?;
        let content = &content[..memchr::memchr(b'<', content)?];
        let end = name.len() + 1 + content.len();
        let after = element[end..].strip_prefix(b"</")?.strip_prefix(name)?.strip_prefix(b">")?;
        self.reader.stream().consume(rest.len() - after.len());
        Some((name, content))
    }

    /// Reads numbers to the end of the element `inside`, or those of its `content` where that is given.
    ///
    /// `take` gets each number; the error of a word that is none is made by `fault`.
    pub(super) fn numbers(
        &mut self,
        inside: &'static str,
        content: Option<&[u8]>,
        mut take: impl FnMut(f64),
        fault: impl Fn(NotANumber) -> MmmFault,
    ) -> Result<(), MmmError> {
        if let Some(content) = content {
            parse_numbers(content, &mut take).map_err(|word| self.fault(fault(word)))?;
            return Ok(());
        }
        loop {
            match self.child(inside)? {
                Node::End => return Ok(()),
                // Text after a comment.
                Node::Text(text) => {
                    let read = parse_numbers(text.as_bytes(), &mut take);
                    read.map_err(|word| self.fault(fault(word)))?;
                }
                Node::Start(start) => {
                    let found = one_line(start.name().as_ref());
                    return Err(self.fault(MmmFault::Unexpected { element: inside, found }));
                }
            }
        }
    }

    /// Skips the rest of the element whose start has just been read.
    pub(super) fn skip(&mut self) -> Result<(), MmmError> {
        let outside = self.depth - 1;
        while self.depth > outside {
            if self.next()?.is_none() {
                return Err(self.fault(MmmFault::Truncated { element: "MMM" }));
            }
        }
        Ok(())
    }

    /// Value of an attribute.
    pub(super) fn attribute(&self, start: &BytesStart<'a>, name: &str) -> Result<Option<String>, MmmError> {
        let syntax = |error: &dyn std::error::Error| self.fault(MmmFault::Syntax { reason: reason(error) });
        let Some(attribute) = start.try_get_attribute(name).map_err(|error| syntax(&error))? else {
            return Ok(None);
        };
        let value =
            attribute.normalized_value(quick_xml::XmlVersion::Explicit1_0).map_err(|error| syntax(&error))?;
        Ok(Some(one_line(&value)))
    }

    fn next(&mut self) -> Result<Option<Node<'a>>, MmmError> {
        if std::mem::take(&mut self.empty_open) {
            self.depth -= 1;
            return Ok(Some(Node::End));
        }
        loop {
            let event = self.reader.read_event();
            self.empty_open = matches!(event, Ok(Event::Empty(_)));
            let fault = match event {
                Ok(Event::Start(start) | Event::Empty(start)) => {
                    self.depth += 1;
                    if self.depth <= MAX_DEPTH {
                        return Ok(Some(Node::Start(start)));
                    }
                    MmmFault::Deep
                }
                Ok(Event::End(_)) => {
                    self.depth -= 1;
                    return Ok(Some(Node::End));
                }
                Ok(Event::Text(text)) => match text.into_inner() {
                    std::borrow::Cow::Borrowed(text) => return Ok(Some(Node::Text(text))),
                    // A reader over a slice lends its text; an owned one would have been changed, which is refused.
                    std::borrow::Cow::Owned(_) => MmmFault::NotXml,
                },
                Ok(Event::Comment(_) | Event::Decl(_) | Event::PI(_)) => continue,
                Ok(Event::Eof) => return Ok(None),
                Ok(Event::DocType(_)) => MmmFault::DocType,
                Ok(Event::GeneralRef(_) | Event::CData(_)) => MmmFault::Reference,
                Err(error) => MmmFault::Syntax { reason: reason(&error) },
            };
            return Err(self.fault(fault));
        }
    }
}

/// Line of a byte position, counted from 1.
fn line_of(document: &[u8], position: usize) -> usize {
    document[..position].split(|&byte| byte == b'\n').count()
}

fn reason(error: &dyn std::error::Error) -> String {
    one_line(&error.to_string())
}
