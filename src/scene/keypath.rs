//! Key paths: where a value stands in a scene file, written as `hair[0].grow.count`.

use std::fmt;

/// One step of a key path.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// Into a table.
    Key(String),
    /// Into a list, from 0.
    Index(usize),
}

/// The way from the top of a scene file to one of its values.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct KeyPath(Vec<Step>);

/// More steps than any scene has: the file format is six levels deep.
const MAX_STEPS: usize = 64;

impl KeyPath {
    /// The path of the whole file: no steps.
    pub fn root() -> Self {
        Self::default()
    }

    /// This path and then the key `key`.
    #[must_use]
    pub fn key(&self, key: &str) -> Self {
        self.step(Step::Key(key.to_owned()))
    }

    /// This path and then the list item `index`.
    #[must_use]
    pub fn index(&self, index: usize) -> Self {
        self.step(Step::Index(index))
    }

    /// This path and then `step`.
    #[must_use]
    pub fn step(&self, step: Step) -> Self {
        let mut steps = Vec::with_capacity(self.0.len() + 1);
        steps.extend_from_slice(&self.0);
        steps.push(step);
        Self(steps)
    }

    /// The steps from the top.
    pub fn steps(&self) -> &[Step] {
        &self.0
    }

    /// Reads `hair[0].grow.count`. An index may also be written as a key, `hair.0.grow.count`: it is then kept as a
    /// key, because only the schema tells whether a list is meant.
    ///
    /// # Errors
    /// A sentence that says what is wrong with the path.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut steps = Vec::new();
        for part in text.trim().split('.') {
            let (name, mut indices) = match part.find('[') {
                Some(at) => part.split_at(at),
                None => (part, ""),
            };
            let name = name.trim();
            if name.is_empty() {
                return Err(format!("\"{}\" is not a key path such as hair[0].width: a key is missing", clip(text)));
            }
            steps.push(Step::Key(name.to_owned()));
            while !indices.is_empty() {
                let inside = indices.strip_prefix('[').and_then(|rest| rest.split_once(']'));
                let Some((digits, rest)) = inside else {
                    return Err(format!("\"{}\" is not a key path: a bracket is not closed", clip(text)));
                };
                let index = digits
                    .trim()
                    .parse()
                    .map_err(|_| format!("\"{}\" is not a key path: [{}] is not an index", clip(text), clip(digits)))?;
                steps.push(Step::Index(index));
                indices = rest;
            }
            if steps.len() > MAX_STEPS {
                return Err(format!("the key path has more than {MAX_STEPS} steps"));
            }
        }
        Ok(Self(steps))
    }
}

impl fmt::Display for KeyPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, step) in self.0.iter().enumerate() {
            match step {
                Step::Index(index) => write!(f, "[{index}]")?,
                Step::Key(key) => {
                    if n > 0 {
                        f.write_str(".")?;
                    }
                    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
                    if !key.is_empty() && key.chars().all(bare) && key.len() <= 60 {
                        f.write_str(key)?;
                    } else {
                        // Quoted with escapes: a hostile key must not reach the terminal raw.
                        write!(f, "{:?}", clip(key))?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// The text, or its first 60 characters and an ellipsis: messages stay readable whatever a file holds.
pub(crate) fn clip(text: &str) -> String {
    const MOST: usize = 60;
    let mut clipped: String = text.chars().take(MOST).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(MOST).is_some() {
        clipped.push('…');
    }
    clipped
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn paths_are_read_and_written_back() {
        for text in ["camera", "camera.fov", "hair[0].grow.count", "light.rect[12].edge_u[2]", "a[1][2]"] {
            assert_eq!(KeyPath::parse(text).unwrap().to_string(), text);
        }
    }

    #[test]
    fn broken_paths_say_what_is_wrong() {
        for (text, part) in [
            ("", "a key is missing"),
            ("a..b", "a key is missing"),
            ("[0].a", "a key is missing"),
            ("a[0", "not closed"),
            ("a[x]", "[x] is not an index"),
            ("a[-1]", "[-1] is not an index"),
            ("a[99999999999999999999999]", "is not an index"),
            ("a[0]b", "not closed"),
        ] {
            let error = KeyPath::parse(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
        assert!(KeyPath::parse(&"a.".repeat(1000)).unwrap_err().contains("steps"));
    }

    #[test]
    fn odd_keys_are_quoted() {
        assert_eq!(KeyPath::root().key("a.b\u{1b}").key("c").to_string(), "\"a.b \".c");
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in ".*") {
            let _ = KeyPath::parse(&text);
        }
    }
}
