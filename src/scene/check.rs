//! Checks a scene file's values against the schema and finds every fault, with messages for those who write scenes.

use serde_json::{Number, Value};

use super::keypath::{KeyPath, Step, clip};
use super::schema::{Kind, Rule, nearest, show_number, unknown_key};

/// Something to say about a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Finding {
    /// The value.
    pub path: KeyPath,
    /// Whether it is about the key rather than its value.
    pub about_key: bool,
    pub message: String,
}

impl Finding {
    pub fn value(path: KeyPath, message: String) -> Self {
        Self { path, about_key: false, message }
    }
}

/// Beyond this many, findings only cost time: a hostile file has millions.
pub(crate) const MAX_FINDINGS: usize = 1000;

/// Every way in which `value` is no scene. Whole numbers written as `10.0` or `1e4` become integers on the way.
pub(crate) fn check(value: &mut Value) -> Vec<Finding> {
    let mut findings = Vec::new();
    check_value(&Rule::root(), value, &KeyPath::root(), &mut findings);
    findings
}

fn check_value(rule: &Rule, value: &mut Value, path: &KeyPath, findings: &mut Vec<Finding>) {
    if findings.len() >= MAX_FINDINGS || (value.is_null() && rule.nullable) {
        return;
    }
    match (rule.kind(), &mut *value) {
        (Kind::Table, Value::Object(_)) => check_table(rule, value, path, findings),
        (Kind::List, Value::Array(_)) => check_list(rule, value, path, findings),
        (Kind::Number, Value::Number(number)) => check_range(rule, number, path, findings),
        (Kind::Integer, Value::Number(number)) => match whole(number) {
            Some(integer) => {
                *number = integer;
                check_range(rule, number, path, findings);
            }
            None => mismatch(rule, value, path, findings),
        },
        (Kind::Choice(words), Value::String(word)) => {
            if !words.contains(&word.as_str()) {
                let hint = nearest(word, words.iter().copied())
                    .map_or_else(String::new, |near| format!("did you mean \"{near}\"? "));
                let message = format!("{path} is \"{}\"; {hint}known: {}", clip(word), words.join(", "));
                findings.push(Finding::value(path.clone(), message));
            }
        }
        (Kind::Text, Value::String(_)) | (Kind::Flag, Value::Bool(_)) | (Kind::Any, _) => {}
        _ => mismatch(rule, value, path, findings),
    }
}

fn check_table(rule: &Rule, value: &mut Value, path: &KeyPath, findings: &mut Vec<Finding>) {
    let Value::Object(map) = value else { return };
    for (key, inner) in map.iter_mut() {
        let here = path.key(key);
        match rule.key(key) {
            Some(rule) => check_value(&rule, inner, &here, findings),
            None if findings.len() >= MAX_FINDINGS => return,
            None => findings.push(Finding { path: here, about_key: true, message: unknown_key(rule, path, key) }),
        }
    }
    for key in rule.required().filter(|&key| !map.contains_key(key)) {
        let meaning = rule.key(key).and_then(|rule| rule.description).unwrap_or_default();
        let message = format!("{path} lacks the key \"{key}\" ({})", meaning.trim_end_matches('.'));
        findings.push(Finding { path: path.clone(), about_key: true, message });
    }
}

fn check_list(rule: &Rule, value: &mut Value, path: &KeyPath, findings: &mut Vec<Finding>) {
    let Value::Array(items) = value else { return };
    let count = items.len() as u64;
    let (least, most) = rule.item_count();
    if least.is_some_and(|least| count < least) || most.is_some_and(|most| count > most) {
        let message = format!("{path}: expected {}, found a list of {count}", rule.expectation());
        findings.push(Finding::value(path.clone(), message));
        return;
    }
    let Some(rule) = rule.items() else { return };
    for (index, item) in items.iter_mut().enumerate() {
        if findings.len() >= MAX_FINDINGS {
            return;
        }
        check_value(&rule, item, &path.index(index), findings);
    }
}

fn check_range(rule: &Rule, number: &Number, path: &KeyPath, findings: &mut Vec<Finding>) {
    let Some(value) = number.as_f64() else { return };
    let range = match rule.range() {
        (Some(least), Some(most)) if value < least || value > most => {
            format!("outside {} to {}", show_number(least), show_number(most))
        }
        (Some(least), _) if value < least => format!("below {}", show_number(least)),
        (_, Some(most)) if value > most => format!("above {}", show_number(most)),
        _ => return,
    };
    let unit = rule.unit().map_or_else(String::new, |unit| format!(" {unit}"));
    let meaning = rule.meaning().map_or_else(String::new, |meaning| format!(" ({meaning})"));
    let message = format!("{path} is {}, {range}{unit}{meaning}", show_number(value));
    findings.push(Finding::value(path.clone(), message));
}

fn mismatch(rule: &Rule, value: &Value, path: &KeyPath, findings: &mut Vec<Finding>) {
    let name = if path.steps().is_empty() { "the scene".to_owned() } else { path.to_string() };
    let mut message = format!("{name}: expected {}, found {}", rule.expectation(), show(value));
    let of_tables = rule.items().is_some_and(|items| items.kind() == Kind::Table);
    if rule.kind() == Kind::List && of_tables && value.is_object() {
        message.push_str(&format!("; in TOML each item starts with [[{path}]], with two brackets"));
    } else if let Some(advice) = advice(rule, path) {
        message.push_str(&advice);
    }
    findings.push(Finding::value(path.clone(), message));
}

/// What to write in place of a value of another kind: the range, and a value that would do.
fn advice(rule: &Rule, path: &KeyPath) -> Option<String> {
    let key = path.steps().iter().rev().find_map(|step| match step {
        Step::Key(key) => Some(key),
        Step::Index(_) => None,
    })?;
    let example = rule.example()?;
    let allowed = match rule.range() {
        (Some(least), Some(most)) => format!(" (allowed: {} to {})", show_number(least), show_number(most)),
        _ => String::new(),
    };
    let is_item = matches!(path.steps().last(), Some(Step::Index(_)));
    Some(if is_item {
        format!("; for example {example}{allowed}")
    } else {
        format!("; for example {key} = {example}{allowed}")
    })
}

/// The number as an integer, where it is one: JSON schema and people both take 1e4 for a whole number.
fn whole(number: &Number) -> Option<Number> {
    // From here on not every whole number is an f64, so it is not sure which was meant.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if number.is_i64() || number.is_u64() {
        return Some(number.clone());
    }
    let value = number.as_f64()?;
    (value.fract() == 0.0 && value.abs() < EXACT).then(|| Number::from(value as i64))
}

fn show(value: &Value) -> String {
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(flag) => flag.to_string(),
        Value::Number(number) => format!("the number {number}"),
        Value::String(text) => format!("a string (\"{}\")", clip(text)),
        Value::Array(items) => format!("a list of {}", items.len()),
        Value::Object(_) => "a table".to_owned(),
    }
}
