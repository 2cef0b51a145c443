//! The reference of the scene file's keys as Markdown, made from the schema, so that it cannot drift from the program.

use std::fmt::Write;

use serde_json::Value;

use super::keypath::KeyPath;
use super::schema::{Kind, Rule};

const HEAD: &str = "# The scene file\n\n\
    A scene is a TOML file, or a JSON file of the same structure. Made by `tress schema --markdown`; `tress schema` prints the same as a JSON schema.\n\n\
    A key that is not listed here is an error. Lengths are in scene units unless a unit is named, colours linear Rec.709, angles in degrees.\n\
    Paths are relative to the scene file. Any key can be set on the command line: `--set camera.fov=40`, `--set hair[0].color=[0.8,0.5,0.2]`.\n\
    Where no default is given, the key is optional and its meaning says what applies without it.\n";

/// Every key of a scene file: a section for each table, a row for each key.
pub fn markdown() -> String {
    let mut text = HEAD.to_owned();
    section(&Rule::root(), &KeyPath::root(), &mut text);
    text
}

fn section(table: &Rule, path: &KeyPath, text: &mut String) {
    // Writing to a string cannot fail.
    let top = path.steps().is_empty();
    let _ = write!(text, "\n## {}\n\n", if top { "Top level".to_owned() } else { format!("`{}`", name(path)) });
    if let Some(description) = table.description.filter(|_| !top) {
        let _ = write!(text, "{description}\n\n");
    }
    text.push_str("| key | value | default | meaning |\n|---|---|---|---|\n");
    let required: Vec<&str> = table.required().collect();
    for (key, rule) in table.keys() {
        let default = match rule.default {
            _ if required.contains(&key) => "required".to_owned(),
            Some(value) if !holds_tables(&rule) => format!("`{}`", short(value)),
            _ => String::new(),
        };
        let meaning = rule.description.unwrap_or_default().replace('|', "\\|");
        let _ = writeln!(text, "| `{key}` | {} | {default} | {meaning}{} |", value(&rule), words(&rule));
    }
    for (key, rule) in table.keys() {
        let path = path.key(key);
        match rule.kind() {
            Kind::Table => section(&rule, &path, text),
            Kind::List => {
                if let Some(items) = rule.items().filter(|items| items.kind() == Kind::Table) {
                    section(&items, &path.index(0), text);
                }
            }
            _ => {}
        }
    }
}

/// A table's path as TOML writes it: `[[hair]]` is `hair[]`.
fn name(path: &KeyPath) -> String {
    path.to_string().replace("[0]", "[]")
}

fn holds_tables(rule: &Rule) -> bool {
    rule.kind() == Kind::Table || rule.items().is_some_and(|items| items.kind() == Kind::Table)
}

/// What is expected, with its range.
fn value(rule: &Rule) -> String {
    let kind = match rule.kind() {
        Kind::Choice(_) => "a word".to_owned(),
        _ => rule.expectation(),
    };
    let mut inner = *rule;
    while let Some(items) = inner.items() {
        inner = items;
    }
    match inner.range() {
        (Some(low), Some(high)) => format!("{kind}, {} to {}", number(low), number(high)),
        _ => kind,
    }
}

/// The words of a choice with their meanings.
fn words(rule: &Rule) -> String {
    let rule = if rule.kind() == Kind::List { rule.items().unwrap_or(*rule) } else { *rule };
    let words = rule.choices().map(|(word, meaning)| match meaning {
        Some(meaning) => format!("<br>`{word}`: {meaning}"),
        None => format!("<br>`{word}`"),
    });
    words.collect()
}

fn number(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) { format!("{value:e}") } else { format!("{value}") }
}

/// A default without needless digits: 5 for 5.0.
fn short(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("[{}]", items.iter().map(short).collect::<Vec<_>>().join(", ")),
        Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), number),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_stand_with_value_range_default_and_meaning() {
        let text = markdown();
        for row in [
            "| `fov` | a number, 0.01 to 179 | `35` | Vertical field of view, in degrees. |",
            "## `light.rect[]`",
            "| `position` | a list of 3 numbers, -1e9 to 1e9 | required | Where it is, in scene units. |",
            "<br>`igloo`: Projection of the hair on the igloo's faces.",
            "<br>`piz`",
        ] {
            assert!(text.contains(row), "{row}\n{text}");
        }
    }
}
