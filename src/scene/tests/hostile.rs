//! Hostile and mutilated scene files: refused with a message, never a panic.

use proptest::prelude::*;

use super::*;
use crate::scene::check;

#[test]
fn deep_nesting_is_an_error() {
    let n = 100_000;
    for text in [
        format!("x = {}{}", "[".repeat(n), "]".repeat(n)),
        format!("{} = 1", vec!["a"; n].join(".")),
        format!("[{}]", vec!["a"; n].join(".")),
        format!("x = {{{} = 1}}", vec!["a"; n].join(".")),
    ] {
        assert!(fault(&text).contains("recurs"), "{}", fault(&text));
    }
    for text in ["[".repeat(n), format!("{}{}", "[".repeat(n), "]".repeat(n)), "{\"a\":".repeat(n)] {
        assert!(read(&text, Format::Json, &[]).unwrap_err().to_string().contains("recursion"));
    }
    assert!(set_fault("", &[&format!("camera.up={}", "[".repeat(n))]).contains("expected a list"));
}

/// Changes one thing, chosen by `n`, somewhere in a JSON value.
fn mutate(value: &mut Value, n: &mut u64) {
    let take = |n: &mut u64, of: u64| {
        let r = *n % of;
        *n = *n / of + 0x9e37_79b9;
        r
    };
    let inner = match value {
        Value::Object(map) if !map.is_empty() && take(n, 8) > 0 => {
            let k = take(n, map.len() as u64) as usize;
            map.values_mut().nth(k)
        }
        Value::Array(items) if !items.is_empty() && take(n, 6) > 0 => {
            let k = take(n, items.len() as u64) as usize;
            items.get_mut(k)
        }
        _ => None,
    };
    if let Some(inner) = inner {
        return mutate(inner, n);
    }
    *value = match (take(n, 10), value.take()) {
        (0, _) => Value::Null,
        (1, _) => Value::from(-1),
        (2, _) => Value::from(1e30),
        (3, _) => Value::from(3.0),
        (4, _) => Value::from("none"),
        (5, _) => Value::from(vec![1, 2, 3]),
        (6, _) => serde_json::json!({}),
        (7, Value::Object(mut map)) => {
            map.insert("extra".to_owned(), Value::from(1));
            Value::Object(map)
        }
        (8, Value::Object(mut map)) => {
            let first = map.keys().next().cloned();
            first.map(|key| map.remove(&key));
            Value::Object(map)
        }
        (_, Value::Array(mut items)) => {
            items.pop();
            Value::Array(items)
        }
        (_, Value::Number(number)) => Value::from(number.as_f64().unwrap_or(0.0) * 1000.0 + 0.5),
        (_, other) => Value::Array(vec![other]),
    };
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// The checker against an independent implementation of JSON schema.
    #[test]
    fn the_checker_agrees_with_json_schema(mut n: u64, times in 1..4) {
        thread_local! {
            static VALIDATOR: jsonschema::Validator = jsonschema::validator_for(schema()).unwrap();
        }
        let mut value = serde_json::to_value(toml(SCENE).description).unwrap();
        for _ in 0..times {
            mutate(&mut value, &mut n);
        }
        let valid = VALIDATOR.with(|validator| validator.is_valid(&value));
        let findings = check::check(&mut value);
        prop_assert_eq!(valid, findings.is_empty(), "{:#}\n{:?}", value, findings);
        if valid {
            prop_assert!(serde_json::from_value::<Description>(value.clone()).is_ok(), "{:#}", value);
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes: Vec<u8>) {
        for format in [Format::Toml, Format::Json] {
            let _ = from_bytes(&bytes, format, Path::new("s"), PathBuf::from("."), &[]).map_err(|e| e.to_string());
        }
    }

    #[test]
    fn mutilated_scenes_are_read_or_refused(cuts in prop::collection::vec((0usize..2000, 0usize..8, "[\\[\\]{}=.\"'#\n,0-9a-zéΓ-]{0,4}"), 1..6)) {
        let json = serde_json::to_string_pretty(&toml(SCENE).description).unwrap();
        for (format, source) in [(Format::Toml, SCENE), (Format::Json, json.as_str())] {
            let mut bytes = source.as_bytes().to_vec();
            for (at, length, insert) in &cuts {
                let at = at % bytes.len();
                let end = (at + length).min(bytes.len());
                bytes.splice(at..end, insert.bytes());
            }
            if let Err(SceneError::Invalid(problems)) = from_bytes(&bytes, format, Path::new("s"), PathBuf::from("."), &[]) {
                prop_assert!(!problems.list.is_empty());
            }
        }
    }

    #[test]
    fn any_override_is_taken_or_refused(key in "(hair|camera|light|surface|a)(\\[[0-9]\\]|\\.[a-z0-9]{1,4}){0,3}", value in ".{0,12}") {
        let _ = read(SCENE, Format::Toml, &[&format!("{key}={value}")]).map_err(|e| e.to_string());
    }
}
