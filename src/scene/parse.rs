//! TOML and JSON to one form: a JSON value, and beside it a tree that knows where each part was written.
//!
//! JSON files are strict JSON without comments, so that any other JSON tool reads them; TOML is for files written by hand.

use std::collections::BTreeMap;

use jsonc_parser::ast;
use jsonc_parser::common::Ranged;
use serde_json::{Map, Number, Value};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::spans::{Children, Node, Origin};

/// A syntax error: byte position and message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SyntaxError {
    pub byte: usize,
    pub message: String,
}

/// Values in one file, lists and tables included. A scene of ten thousand lights has a tenth of it.
const MAX_VALUES: usize = 1_000_000;

/// Where two errors follow from one slip, more of them do not help.
const MAX_SYNTAX_ERRORS: usize = 5;

type Parsed = Result<(Value, Node), Vec<SyntaxError>>;

/// Reads TOML. Infinite numbers, `nan`, dates and times are errors: nothing in a scene can be one of them.
pub(crate) fn toml(text: &str) -> Parsed {
    let (table, errors) = DeTable::parse_recoverable(text);
    if !errors.is_empty() {
        let error = |e: toml::de::Error| SyntaxError {
            byte: e.span().map_or(0, |span| span.start),
            message: e.message().lines().collect::<Vec<_>>().join("; "),
        };
        return Err(errors.into_iter().take(MAX_SYNTAX_ERRORS).map(error).collect());
    }
    let mut reader = Reader::default();
    let read = reader.toml_table(table.get_ref(), Origin::Text { key: 0, value: 0 });
    reader.finish(read)
}

/// Reads one TOML value, as in `--set key=VALUE`. `Ok(None)` when the text is no TOML value.
pub(crate) fn toml_value(text: &str) -> Result<Option<Value>, String> {
    let Ok(value) = DeValue::parse(text) else { return Ok(None) };
    let mut reader = Reader::default();
    let read = reader.toml_value(value.get_ref(), Origin::Text { key: 0, value: 0 });
    match reader.finish(read) {
        Ok((value, _)) => Ok(Some(value)),
        Err(errors) => Err(errors.into_iter().map(|e| e.message).next().unwrap_or_default()),
    }
}

/// Reads JSON.
pub(crate) fn json(text: &str) -> Parsed {
    // serde_json decides what JSON is (the other parser is lenient) and bounds the depth of nesting to 128.
    if let Err(e) = serde_json::from_str::<Value>(text) {
        let message = e.to_string();
        let message = message.split(" at line ").next().unwrap_or_default().to_owned();
        return Err(vec![SyntaxError { byte: byte_of(text, e.line(), e.column()), message }]);
    }
    match jsonc_parser::parse_to_ast(text, &Default::default(), &Default::default()) {
        Ok(jsonc_parser::ParseResult { value: Some(value), .. }) => {
            let mut reader = Reader::default();
            let at = value.start();
            let read = reader.json_value(&value, Origin::Text { key: at, value: at });
            reader.finish(read)
        }
        Ok(_) => Err(vec![SyntaxError { byte: 0, message: "the file is empty".to_owned() }]),
        Err(e) => Err(vec![SyntaxError { byte: e.range().start, message: e.kind().to_string() }]),
    }
}

/// The byte position of serde_json's line and column, both from 1 and in bytes; 0 stands for the start.
fn byte_of(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    (start + column.saturating_sub(1)).min(text.len())
}

#[derive(Default)]
struct Reader {
    values: usize,
    errors: Vec<SyntaxError>,
}

impl Reader {
    fn finish(self, read: (Value, Node)) -> Parsed {
        if self.errors.is_empty() { Ok(read) } else { Err(self.errors) }
    }

    fn error(&mut self, origin: Origin, message: String) {
        let byte = match origin {
            Origin::Text { value, .. } => value,
            Origin::Set(_) => 0,
        };
        self.errors.push(SyntaxError { byte, message });
    }

    /// Counts one value; false once there are too many, which is reported once.
    fn count(&mut self, origin: Origin) -> bool {
        self.values += 1;
        if self.values == MAX_VALUES + 1 {
            self.error(origin, format!("the file has more than {MAX_VALUES} values, which no scene needs"));
        }
        self.values <= MAX_VALUES
    }

    fn number(&mut self, text: &str, origin: Origin) -> Value {
        let finite = text.parse::<f64>().ok().and_then(Number::from_f64);
        finite.map(Value::Number).unwrap_or_else(|| {
            self.error(origin, format!("{} is not a finite number; give one", super::keypath::clip(text)));
            Value::Null
        })
    }

    fn toml_table(&mut self, table: &DeTable<'_>, origin: Origin) -> (Value, Node) {
        let (mut map, mut fields) = (Map::new(), BTreeMap::new());
        for (key, value) in table {
            let origin = Origin::Text { key: key.span().start, value: value.span().start };
            if !self.count(origin) {
                break;
            }
            let (value, node) = self.toml_value(value.get_ref(), origin);
            map.insert(key.get_ref().to_string(), value);
            fields.insert(key.get_ref().to_string(), node);
        }
        (Value::Object(map), Node { origin, children: Children::Fields(fields) })
    }

    fn toml_value(&mut self, value: &DeValue<'_>, origin: Origin) -> (Value, Node) {
        let value = match value {
            DeValue::Table(table) => return self.toml_table(table, origin),
            DeValue::Array(array) => {
                let (mut values, mut nodes) = (Vec::new(), Vec::new());
                for item in array.iter() {
                    let at = Spanned::span(item).start;
                    let origin = Origin::Text { key: at, value: at };
                    if !self.count(origin) {
                        break;
                    }
                    let (value, node) = self.toml_value(item.get_ref(), origin);
                    values.push(value);
                    nodes.push(node);
                }
                return (Value::Array(values), Node { origin, children: Children::Items(nodes) });
            }
            DeValue::String(text) => Value::String(text.to_string()),
            DeValue::Boolean(flag) => Value::Bool(*flag),
            DeValue::Integer(integer) => match i64::from_str_radix(integer.as_str(), integer.radix()) {
                Ok(integer) => Value::from(integer),
                Err(_) => {
                    self.error(
                        origin,
                        format!("{} is too large for a whole number", super::keypath::clip(integer.as_str())),
                    );
                    Value::Null
                }
            },
            DeValue::Float(float) => self.number(float.as_str(), origin),
            DeValue::Datetime(datetime) => {
                self.error(
                    origin,
                    format!("{datetime} is a date or time, which nothing in a scene is; quote it if it is a name"),
                );
                Value::Null
            }
        };
        (value, Node::leaf(origin))
    }

    fn json_value(&mut self, value: &ast::Value<'_>, origin: Origin) -> (Value, Node) {
        let value = match value {
            ast::Value::Object(object) => {
                let (mut map, mut fields) = (Map::new(), BTreeMap::new());
                for property in &object.properties {
                    let origin = Origin::Text { key: property.start(), value: property.value.start() };
                    if !self.count(origin) {
                        break;
                    }
                    let key = property.name.as_str();
                    let (value, node) = self.json_value(&property.value, origin);
                    if map.insert(key.to_owned(), value).is_some() {
                        let message = format!("the key \"{}\" is given twice", super::keypath::clip(key));
                        self.errors.push(SyntaxError { byte: property.start(), message });
                    }
                    fields.insert(key.to_owned(), node);
                }
                return (Value::Object(map), Node { origin, children: Children::Fields(fields) });
            }
            ast::Value::Array(array) => {
                let (mut values, mut nodes) = (Vec::new(), Vec::new());
                for item in &array.elements {
                    let origin = Origin::Text { key: item.start(), value: item.start() };
                    if !self.count(origin) {
                        break;
                    }
                    let (value, node) = self.json_value(item, origin);
                    values.push(value);
                    nodes.push(node);
                }
                return (Value::Array(values), Node { origin, children: Children::Items(nodes) });
            }
            ast::Value::StringLit(literal) => Value::String(literal.value.to_string()),
            ast::Value::BooleanLit(literal) => Value::Bool(literal.value),
            ast::Value::NullKeyword(_) => Value::Null,
            ast::Value::NumberLit(literal) => match literal.value.parse::<i64>() {
                Ok(integer) => Value::from(integer),
                Err(_) => self.number(literal.value, origin),
            },
        };
        (value, Node::leaf(origin))
    }
}
