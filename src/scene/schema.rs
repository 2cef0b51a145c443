//! The JSON schema of a scene file, made from the types in [`super::description`], and questions to it.

use std::sync::OnceLock;

use serde_json::Value;

use super::description::Description;
use super::keypath::{KeyPath, Step, clip};

/// The JSON schema (draft 2020-12) of a scene file: keys, types, units, ranges and defaults, with their descriptions.
pub fn schema() -> &'static Value {
    static SCHEMA: OnceLock<Value> = OnceLock::new();
    SCHEMA.get_or_init(|| schemars::schema_for!(Description).to_value())
}

/// What a value may be.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Table,
    List,
    Number,
    Integer,
    Text,
    Flag,
    /// One of these words.
    Choice(Vec<&'static str>),
    /// The schema says nothing that this code knows.
    Any,
}

/// One place of the schema with its references followed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    body: &'static Value,
    /// What the key means; the key's own words before those of its type.
    pub description: Option<&'static str>,
    /// What applies where the key is missing.
    pub default: Option<&'static Value>,
    /// Whether JSON's null stands for "not given".
    pub nullable: bool,
}

impl Rule {
    /// The rule of the whole file.
    pub fn root() -> Self {
        Self::of(schema())
    }

    fn of(schema: &'static Value) -> Self {
        let mut rule = Rule {
            body: schema,
            description: schema.get("description").and_then(Value::as_str),
            default: schema.get("default").filter(|default| !default.is_null()),
            nullable: false,
        };
        // References and optional alternatives nest two deep at most; the bound only keeps this from running for ever.
        for _ in 0..8 {
            if let Some(name) = rule.body.get("$ref").and_then(Value::as_str) {
                let Some(target) = name.strip_prefix('#').and_then(|pointer| self::schema().pointer(pointer)) else {
                    break;
                };
                rule.body = target;
            } else if let Some(options) = rule.body.get("anyOf").and_then(Value::as_array) {
                let Some(target) = options.iter().find(|option| !is_null(option)) else { break };
                rule.nullable |= options.iter().any(is_null);
                rule.body = target;
            } else {
                break;
            }
            rule.description = rule.description.or(rule.body.get("description").and_then(Value::as_str));
        }
        if let Some(types) = rule.body.get("type").and_then(Value::as_array) {
            rule.nullable |= types.iter().any(|name| name == "null");
        }
        rule
    }

    pub fn kind(&self) -> Kind {
        let words: Vec<&str> = self.choices().map(|(word, _)| word).collect();
        if !words.is_empty() {
            return Kind::Choice(words);
        }
        let name = match self.body.get("type") {
            Some(Value::String(name)) => Some(name.as_str()),
            Some(Value::Array(names)) => names.iter().filter_map(Value::as_str).find(|&name| name != "null"),
            _ => None,
        };
        match name {
            Some("object") => Kind::Table,
            Some("array") => Kind::List,
            Some("number") => Kind::Number,
            Some("integer") => Kind::Integer,
            Some("string") => Kind::Text,
            Some("boolean") => Kind::Flag,
            _ => Kind::Any,
        }
    }

    /// The words of a choice, each with its meaning.
    pub fn choices(&self) -> impl Iterator<Item = (&'static str, Option<&'static str>)> + use<> {
        let list = |key| self.body.get(key).and_then(Value::as_array).into_iter().flatten();
        let plain = list("enum").filter_map(Value::as_str).map(|word| (word, None));
        let described = list("oneOf").flat_map(|option| {
            let meaning = option.get("description").and_then(Value::as_str);
            let several = option.get("enum").and_then(Value::as_array).into_iter().flatten();
            let words = option.get("const").into_iter().chain(several).filter_map(Value::as_str);
            words.map(move |word| (word, meaning))
        });
        plain.chain(described)
    }

    /// The keys of a table, with their rules.
    pub fn keys(&self) -> impl Iterator<Item = (&'static str, Rule)> + use<> {
        let properties = self.body.get("properties").and_then(Value::as_object);
        properties.into_iter().flatten().map(|(key, schema)| (key.as_str(), Rule::of(schema)))
    }

    /// The rule of one key of a table.
    pub fn key(&self, key: &str) -> Option<Rule> {
        self.body.get("properties")?.get(key).map(Rule::of)
    }

    /// The keys that a table must have.
    pub fn required(&self) -> impl Iterator<Item = &'static str> + use<> {
        self.body.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str)
    }

    /// The rule of a list's items. They mean what the list means, where they say nothing themselves.
    pub fn items(&self) -> Option<Rule> {
        let mut rule = Rule::of(self.body.get("items")?);
        rule.description = rule.description.or(self.description);
        Some(rule)
    }

    /// The fewest and the most items of a list.
    pub fn item_count(&self) -> (Option<u64>, Option<u64>) {
        let number = |key| self.body.get(key).and_then(Value::as_u64);
        (number("minItems"), number("maxItems"))
    }

    /// The least and the greatest value of a number.
    pub fn range(&self) -> (Option<f64>, Option<f64>) {
        let number = |key| self.body.get(key).and_then(Value::as_f64);
        (number("minimum"), number("maximum"))
    }

    /// The unit that the description names, as "degrees" out of "Vertical field of view, in degrees."
    pub fn unit(&self) -> Option<&'static str> {
        let text = self.description?;
        let from = text.rfind(", in ").or_else(|| text.rfind(". In "))? + ", in ".len();
        let rest = &text[from..];
        let to = rest.find([',', ';']).into_iter().chain(rest.find(". ")).min().unwrap_or(rest.len());
        Some(rest[..to].trim_end_matches('.'))
    }

    /// The first sentence of the description, without its unit and full stop.
    pub fn meaning(&self) -> Option<&'static str> {
        let text = self.description?;
        let sentence = &text[..text.find(". ").unwrap_or(text.len())];
        let sentence = sentence.trim_end_matches('.');
        Some(match self.unit() {
            Some(unit) => sentence.strip_suffix(unit).and_then(|s| s.strip_suffix(", in ")).unwrap_or(sentence),
            None => sentence,
        })
    }

    /// A value that fits, as TOML and `--set` write it: the default, else the least or 1; none where that says nothing.
    pub fn example(&self) -> Option<String> {
        let holds_tables = |value: &Value| {
            value.is_object() || value.as_array().is_some_and(|items| items.iter().any(Value::is_object))
        };
        let empty = |value: &Value| value.as_array().is_some_and(Vec::is_empty);
        if let Some(default) = self.default.filter(|value| !holds_tables(value) && !empty(value)) {
            return Some(short(default));
        }
        let number = || {
            let (least, most) = self.range();
            1.0_f64.max(least.unwrap_or(1.0)).min(most.unwrap_or(f64::INFINITY))
        };
        match self.kind() {
            Kind::Number | Kind::Integer => Some(number().to_string()),
            Kind::Flag => Some("true".to_owned()),
            Kind::Choice(words) => words.first().map(|word| format!("\"{word}\"")),
            Kind::List => {
                let (least, _) = self.item_count();
                let item = self.items()?.example()?;
                Some(format!("[{}]", vec![item; usize::try_from(least.unwrap_or(1).clamp(1, 4)).ok()?].join(", ")))
            }
            Kind::Table | Kind::Text | Kind::Any => None,
        }
    }

    /// What is expected here, in words: "a list of 3 numbers".
    pub fn expectation(&self) -> String {
        match self.kind() {
            Kind::Table => "a table".to_owned(),
            Kind::Number => "a number".to_owned(),
            Kind::Integer => "a whole number".to_owned(),
            Kind::Text => "a string".to_owned(),
            Kind::Flag => "true or false".to_owned(),
            Kind::Choice(words) => format!("one of {}", words.join(", ")),
            Kind::Any => "a value".to_owned(),
            Kind::List => {
                let things = match self.items().map(|items| items.kind()) {
                    Some(Kind::Table) => "tables",
                    Some(Kind::List) => "lists",
                    Some(Kind::Number) => "numbers",
                    Some(Kind::Integer) => "whole numbers",
                    Some(Kind::Text) => "strings",
                    Some(Kind::Choice(_)) => "names",
                    _ => "values",
                };
                match self.item_count() {
                    (Some(least), Some(most)) if least == most => format!("a list of {least} {things}"),
                    _ => format!("a list of {things}"),
                }
            }
        }
    }
}

/// A value without needless digits: 5 for 5.0.
pub(crate) fn short(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("[{}]", items.iter().map(short).collect::<Vec<_>>().join(", ")),
        Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), show_number),
        other => other.to_string(),
    }
}

/// A number as people write it: 0.01, 20000000, 1e-9, 1e20.
pub(crate) fn show_number(value: f64) -> String {
    let size = value.abs();
    if value != 0.0 && !(1e-4..1e9).contains(&size) { format!("{value:e}") } else { format!("{value}") }
}

fn is_null(schema: &Value) -> bool {
    schema.get("type").is_some_and(|name| name == "null")
}

/// Follows a key path through the schema; an index may be written as a key there.
///
/// # Errors
/// A message that names the step that does not exist and the nearest that does.
pub(crate) fn follow(path: &KeyPath) -> Result<(KeyPath, Vec<Rule>), String> {
    let mut at = KeyPath::root();
    let mut rules = vec![Rule::root()];
    for step in path.steps() {
        let rule = rules[rules.len() - 1];
        let (next, step) = match (rule.kind(), step) {
            (Kind::Table, Step::Key(key)) => (rule.key(key).ok_or_else(|| unknown_key(&rule, &at, key))?, step.clone()),
            (Kind::Table, Step::Index(_)) => return Err(format!("{at} is a table, not a list")),
            (Kind::List, step) => {
                let index = match step {
                    Step::Index(index) => *index,
                    Step::Key(key) => key.parse().map_err(|_| {
                        format!("{at} is a list: say which of its items is meant, as in {at}[0].{}", clip(key))
                    })?,
                };
                (rule.items().ok_or_else(|| format!("{at} has no items"))?, Step::Index(index))
            }
            _ => return Err(format!("{at} is {}: nothing is inside it", rule.expectation())),
        };
        at = at.step(step);
        rules.push(next);
    }
    Ok((at, rules))
}

/// The message for a key that the table at `path` does not have: with the nearest key of the table, or else the
/// place where a key of that name exists, or else all keys of the table.
pub(crate) fn unknown_key(table: &Rule, path: &KeyPath, key: &str) -> String {
    let known: Vec<&str> = table.keys().map(|(key, _)| key).collect();
    let place = if path.steps().is_empty() { "at the top level".to_owned() } else { format!("in {path}") };
    let start = format!("unknown key \"{}\" {place}", clip(key));
    if let Some(near) = nearest(key, known.iter().copied()) {
        return format!("{start}; did you mean \"{near}\"?");
    }
    let elsewhere: Vec<String> =
        places().iter().filter(|(name, _)| same_word(name, key)).map(|(_, path)| path.clone()).take(4).collect();
    match elsewhere.is_empty() {
        false => format!("{start}; did you mean {}?", elsewhere.join(" or ")),
        true => format!("{start}; known keys: {}", known.join(", ")),
    }
}

/// Every key of the schema with its path, list items written `[0]`.
fn places() -> &'static [(&'static str, String)] {
    static PLACES: OnceLock<Vec<(&'static str, String)>> = OnceLock::new();
    fn collect(rule: Rule, path: &KeyPath, depth: usize, out: &mut Vec<(&'static str, String)>) {
        if let Some(items) = rule.items() {
            return collect(items, &path.index(0), depth, out);
        }
        for (key, inner) in rule.keys().filter(|_| depth < 8) {
            let path = path.key(key);
            out.push((key, path.to_string()));
            collect(inner, &path, depth + 1, out);
        }
    }
    PLACES.get_or_init(|| {
        let mut out = Vec::new();
        collect(Rule::root(), &KeyPath::root(), 0, &mut out);
        out
    })
}

fn plain(word: &str) -> String {
    word.to_lowercase().replace(['-', ' '], "_")
}

fn same_word(a: &str, b: &str) -> bool {
    plain(a) == plain(b)
}

/// The candidate nearest to `word`, if one is near enough to be what was meant: a third of its letters wrong at most,
/// or its beginning.
pub(crate) fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    // Longer words are no slip of the pen, and the distance costs the product of the lengths.
    if word.is_empty() || word.len() > 100 {
        return None;
    }
    let word = plain(word);
    let letters = word.chars().count();
    let scored = candidates.filter_map(|candidate| {
        let other = plain(candidate);
        let distance = strsim::damerau_levenshtein(&word, &other);
        let begins = letters >= 3 && other.starts_with(&word);
        (distance <= letters.max(3) / 3 || begins).then_some((distance, candidate))
    });
    scored.min().map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Calls `visit` for each number in the schema, with its path and rule.
    fn numbers(rule: Rule, path: &KeyPath, visit: &mut impl FnMut(&KeyPath, &Rule)) {
        match rule.kind() {
            Kind::Number | Kind::Integer => visit(path, &rule),
            Kind::Table => rule.keys().for_each(|(key, inner)| numbers(inner, &path.key(key), visit)),
            Kind::List => numbers(rule.items().unwrap(), &path.index(0), visit),
            Kind::Any => panic!("{path}: the schema has a form that the reader does not know"),
            Kind::Text | Kind::Flag | Kind::Choice(_) => {}
        }
    }

    #[test]
    fn every_number_has_a_meaning_and_a_range() {
        let mut count = 0;
        numbers(Rule::root(), &KeyPath::root(), &mut |path, rule| {
            count += 1;
            let (Some(least), Some(most)) = rule.range() else { panic!("{path} has no range") };
            assert!(least < most, "{path}");
            assert!(rule.meaning().is_some_and(|text| text.len() > 5), "{path} has no description");
            if rule.kind() == Kind::Integer {
                assert!(least >= 0.0 && most <= f64::from(u32::MAX), "{path} does not fit its type");
            }
        });
        assert!(count > 50, "{count} numbers: the walk does not reach them");
    }

    #[test]
    fn every_key_has_a_description() {
        fn walk(rule: Rule, path: &KeyPath) {
            for (key, inner) in rule.keys() {
                let path = path.key(key);
                assert!(inner.description.is_some(), "{path}");
                walk(inner, &path);
            }
            if let Some(items) = rule.items() {
                walk(items, &path.index(0));
            }
        }
        walk(Rule::root(), &KeyPath::root());
    }

    #[test]
    fn units_come_from_the_descriptions() {
        let unit = |path: &str| follow(&KeyPath::parse(path).unwrap()).unwrap().1.last().unwrap().unit();
        assert_eq!(unit("camera.fov"), Some("degrees"));
        assert_eq!(unit("camera.position[0]"), Some("scene units"));
        assert_eq!(unit("light.rect[0].radiance"), Some("W/(m² sr)"));
        assert_eq!(unit("occlusion.thinning.distance_unit"), Some("scene units"));
        assert_eq!(unit("camera.resolution"), Some("pixels"));
        assert_eq!(unit("hair[0].grow.count"), None);
    }

    #[test]
    fn the_schema_is_a_schema_with_title_and_defaults() {
        assert_eq!(schema()["title"], "Tress scene");
        assert!(schema().get("$id").is_none());
        assert_eq!(schema()["properties"]["camera"]["default"]["fov"], 35.0);
        assert_eq!(schema()["additionalProperties"], false);
        jsonschema::meta::validate(schema()).unwrap();
    }

    #[test]
    fn near_words_are_found_and_far_ones_are_not() {
        let keys = ["width", "width_tip", "exponent", "color", "resolution"];
        let find = |word| nearest(word, keys.iter().copied());
        assert_eq!(find("widht"), Some("width"));
        assert_eq!(find("colour"), Some("color"));
        assert_eq!(find("Width-Tip"), Some("width_tip"));
        assert_eq!(find("res"), Some("resolution"));
        assert_eq!(find("banana"), None);
        assert_eq!(find(""), None);
        assert_eq!(find(&"w".repeat(1 << 20)), None);
    }
}
