//! `--set key.path=value`: values given on the command line in place of the file's.

use serde_json::{Map, Value};

use super::keypath::{KeyPath, Step, clip};
use super::parse;
use super::schema::{Kind, Rule, follow};
use super::spans::{Node, Origin};

/// Puts each override into `value` and its origin into `node`. Gives the faults: number of the override and message.
pub(crate) fn apply(value: &mut Value, node: &mut Node, overrides: &[String]) -> Vec<(usize, String)> {
    let one = |(n, text): (usize, &String)| apply_one(value, node, n, text).err().map(|message| (n, message));
    overrides.iter().enumerate().filter_map(one).collect()
}

fn apply_one(value: &mut Value, node: &mut Node, n: usize, text: &str) -> Result<(), String> {
    let Some((key, raw)) = text.split_once('=') else {
        return Err("a value is missing; write key.path=value, as in camera.fov=40".to_owned());
    };
    let (path, rules) = follow(&KeyPath::parse(key)?)?;
    let rule = rules[rules.len() - 1];
    put(value, node, &path, &rules, Origin::Set(n), parse_value(raw.trim(), &rule)?)
}

/// A TOML value; where it is none, or a string is wanted and it is no string, the bare text.
fn parse_value(raw: &str, rule: &Rule) -> Result<Value, String> {
    if matches!(rule.kind(), Kind::Text | Kind::Choice(_)) {
        return Ok(match parse::toml_value(raw) {
            Ok(Some(Value::String(text))) => Value::String(text),
            _ => Value::String(raw.to_owned()),
        });
    }
    Ok(parse::toml_value(raw)?.unwrap_or_else(|| Value::String(raw.to_owned())))
}

/// Sets what is at `path`. What is missing on the way is made: lists from their defaults, tables empty.
fn put(
    value: &mut Value,
    node: &mut Node,
    path: &KeyPath,
    rules: &[Rule],
    origin: Origin,
    new: Value,
) -> Result<(), String> {
    let (mut slot, mut node) = (value, node);
    let mut at = KeyPath::root();
    for (step, rule) in path.steps().iter().zip(rules) {
        slot = match step {
            Step::Key(key) => {
                if !slot.is_object() {
                    *slot = Value::Object(Map::new());
                }
                let Value::Object(map) = slot else { unreachable!("set just above") };
                map.entry(key.clone()).or_insert(Value::Null)
            }
            Step::Index(index) => {
                if !slot.is_array() {
                    *slot = rule
                        .default
                        .filter(|default| default.is_array())
                        .cloned()
                        .unwrap_or_else(|| Value::Array(vec![]));
                }
                let Value::Array(items) = slot else { unreachable!("set just above") };
                // One past the end appends, so that a scene can be given its first light or hair.
                let count = items.len();
                let fixed = rule.item_count().1.is_some_and(|most| *index as u64 >= most);
                if fixed || *index > count {
                    return Err(format!("{at} has {count} items, counted from 0: {} does not exist", at.index(*index)));
                }
                if *index == count {
                    items.push(Value::Null);
                }
                &mut items[*index]
            }
        };
        node = node.child_or_insert(step, origin);
        at = at.step(step.clone());
    }
    *slot = new;
    *node = Node::leaf(origin);
    Ok(())
}

/// Whether `text` is of the form of an override; for the command line, which refuses others as misuse.
///
/// # Errors
/// A message that shows the form.
pub fn check_form(text: &str) -> Result<(), String> {
    match text.split_once('=') {
        Some((key, _)) => KeyPath::parse(key).map(|_| ()),
        None => Err(format!("\"{}\" has no =; write key.path=value, as in camera.fov=40", clip(text))),
    }
}
