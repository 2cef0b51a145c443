//! Where each value of a scene file was written: byte positions, and lines and columns made from them.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use super::keypath::{KeyPath, Step};

/// Where something was written. The order is that of the file, what the command line says after it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// In a file; line and column count from 1, the column in characters.
    File {
        /// The scene file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
    },
    /// In `--set KEY=VALUE`, of which this is the argument.
    Override(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::File { path, line, column } => write!(f, "{}:{line}:{column}", path.display()),
            Place::Override(text) => write!(f, "--set {}", super::keypath::clip(text)),
        }
    }
}

/// Who wrote a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// The file: byte positions of its key (of the value itself in a list) and of the value.
    Text { key: usize, value: usize },
    /// The override of this number.
    Set(usize),
}

/// The origin of a value and of all that is in it: a tree in step with the values.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub origin: Origin,
    pub children: Children,
}

/// What is inside a value.
#[derive(Clone, Debug)]
pub(crate) enum Children {
    None,
    Items(Vec<Node>),
    Fields(BTreeMap<String, Node>),
}

impl Node {
    pub fn leaf(origin: Origin) -> Self {
        Self { origin, children: Children::None }
    }

    fn child(&self, step: &Step) -> Option<&Node> {
        match (&self.children, step) {
            (Children::Fields(fields), Step::Key(key)) => fields.get(key),
            (Children::Items(items), Step::Index(index)) => items.get(*index),
            _ => None,
        }
    }

    /// The child at `step`; made where it is missing, then with `origin`. The caller bounds the index.
    pub fn child_or_insert(&mut self, step: &Step, origin: Origin) -> &mut Node {
        match step {
            Step::Key(key) => {
                if !matches!(self.children, Children::Fields(_)) {
                    self.children = Children::Fields(BTreeMap::new());
                }
                let Children::Fields(fields) = &mut self.children else { unreachable!("set just above") };
                fields.entry(key.clone()).or_insert_with(|| Node::leaf(origin))
            }
            Step::Index(index) => {
                if !matches!(self.children, Children::Items(_)) {
                    self.children = Children::Items(Vec::new());
                }
                let Children::Items(items) = &mut self.children else { unreachable!("set just above") };
                while items.len() <= *index {
                    items.push(Node::leaf(origin));
                }
                &mut items[*index]
            }
        }
    }
}

/// Finds the place of a key path in the scene file or among the overrides.
#[derive(Clone, Debug)]
pub struct Spans {
    path: PathBuf,
    text: String,
    line_starts: Vec<usize>,
    pub(crate) root: Node,
    pub(crate) overrides: Vec<String>,
}

impl Spans {
    pub(crate) fn new(path: &Path, text: String, root: Node, overrides: &[String]) -> Self {
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { path: path.to_owned(), text, line_starts, root, overrides: overrides.to_owned() }
    }

    /// The place of the value at `path`, or of the nearest thing around it that was written.
    pub fn value(&self, path: &KeyPath) -> Place {
        self.place(self.nearest(path).origin, false)
    }

    /// Where in the order of the file, and of the overrides after it, [`Spans::value`] or [`Spans::key`] lies.
    pub(crate) fn order(&self, path: &KeyPath, of_key: bool) -> (bool, usize) {
        match self.nearest(path).origin {
            Origin::Text { key, value } => (false, if of_key { key } else { value }),
            Origin::Set(n) => (true, n),
        }
    }

    /// The same, but of the value's key.
    pub fn key(&self, path: &KeyPath) -> Place {
        self.place(self.nearest(path).origin, true)
    }

    /// Whether the file or an override has something at `path`; false where the default applies.
    pub fn given(&self, path: &KeyPath) -> bool {
        path.steps().iter().try_fold(&self.root, |node, step| node.child(step)).is_some()
    }

    fn nearest(&self, path: &KeyPath) -> &Node {
        let mut node = &self.root;
        for step in path.steps() {
            match node.child(step) {
                Some(child) => node = child,
                None => break,
            }
        }
        node
    }

    fn place(&self, origin: Origin, of_key: bool) -> Place {
        match origin {
            Origin::Text { key, value } => self.at(if of_key { key } else { value }),
            Origin::Set(n) => Place::Override(self.overrides.get(n).cloned().unwrap_or_default()),
        }
    }

    /// The line and column of a byte position; the last character's where the position is past the end.
    pub(crate) fn at(&self, byte: usize) -> Place {
        let byte = byte.min(self.text.len());
        let line = self.line_starts.partition_point(|&start| start <= byte).max(1);
        let start = self.line_starts[line - 1];
        // Counted over whole characters that start before the position, so that a position inside one is no slip.
        let column = 1 + self.text[start..].char_indices().take_while(|&(at, _)| start + at < byte).count();
        Place::File { path: self.path.clone(), line, column }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters() {
        let text = "Γ = 1\nab = 'ü' # c\n";
        let root = Node::leaf(Origin::Text { key: 0, value: 0 });
        let spans = Spans::new(Path::new("s.toml"), text.to_owned(), root, &[]);
        assert_eq!(spans.at(text.find('1').unwrap()).to_string(), "s.toml:1:5");
        assert_eq!(spans.at(text.find('#').unwrap()).to_string(), "s.toml:2:10");
        assert_eq!(spans.at(text.len()).to_string(), "s.toml:3:1");
        assert_eq!(spans.at(usize::MAX).to_string(), "s.toml:3:1");
    }
}
