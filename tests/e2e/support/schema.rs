//! Checking JSON against the part of JSON Schema (2020-12) that the schemas of this repository use.
//!
//! Written by ourselves, as a library for all of it brings fifty crates. A word it does not know is an error,
//! so that nothing goes unchecked.

use std::fs;

use serde_json::{Map, Value};

/// A schema.
#[derive(Debug)]
pub struct Schema {
    root: Value,
}

/// Keywords without constraints.
const NOTES: [&str; 5] = ["$schema", "$defs", "title", "description", "required"];

impl Schema {
    /// The schema in the file `name` of the book.
    ///
    /// # Panics
    /// If it is not there or no JSON.
    pub fn of_book(name: &str) -> Self {
        let path = super::root().join("docs").join(name);
        let text = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Self { root: serde_json::from_slice(&text).unwrap_or_else(|error| panic!("{name}: {error}")) }
    }

    /// Violations of the schema in `value`, one line each, beginning with the path.
    pub fn faults(&self, value: &Value) -> Vec<String> {
        let mut faults = Vec::new();
        self.check(&self.root, value, "", &mut faults);
        faults
    }

    /// Objects of the schema that are not strict: additional keys are allowed, or described keys are
    /// optional in every kind of the object.
    pub fn gaps(&self) -> Vec<String> {
        let mut gaps = Vec::new();
        gaps_of(&self.root, "", &mut gaps);
        gaps
    }

    fn check(&self, schema: &Value, value: &Value, at: &str, faults: &mut Vec<String>) {
        let Some(words) = schema.as_object() else { panic!("{at}: the schema is no object: {schema}") };
        for (word, what) in words {
            let holds = match word.as_str() {
                "const" => what == value,
                "enum" => list(what).contains(value),
                "type" => match what {
                    Value::Array(types) => types.iter().any(|of| is_of(value, of)),
                    of => is_of(value, of),
                },
                "minimum" => value.as_f64().is_none_or(|number| Some(number) >= what.as_f64()),
                "maxProperties" => {
                    value.as_object().is_none_or(|fields| Some(fields.len() as u64) <= what.as_u64())
                }
                "minItems" => value.as_array().is_none_or(|items| Some(items.len() as u64) >= what.as_u64()),
                "maxItems" => value.as_array().is_none_or(|items| Some(items.len() as u64) <= what.as_u64()),
                "anyOf" => list(what).iter().any(|schema| {
                    let mut inside = Vec::new();
                    self.check(schema, value, at, &mut inside);
                    inside.is_empty()
                }),
                "$ref" => {
                    let to = what.as_str().and_then(|path| self.root.pointer(path.strip_prefix('#')?));
                    self.check(to.unwrap_or_else(|| panic!("{at}: no {what}")), value, at, faults);
                    true
                }
                "items" => {
                    let items = value.as_array().into_iter().flatten().enumerate();
                    items.for_each(|(index, item)| self.check(what, item, &format!("{at}/{index}"), faults));
                    true
                }
                "properties" | "additionalProperties" => true,
                note if NOTES.contains(&note) => true,
                unknown => panic!("{at}: this checker does not know `{unknown}`"),
            };
            if !holds {
                faults.push(format!("{at}: {value} does not satisfy {word}: {what}"));
            }
        }
        if let Some(fields) = value.as_object() {
            self.check_fields(words, fields, at, faults);
        }
    }

    fn check_fields(
        &self,
        words: &Map<String, Value>,
        fields: &Map<String, Value>,
        at: &str,
        faults: &mut Vec<String>,
    ) {
        let known = words.get("properties").and_then(Value::as_object);
        let other = words.get("additionalProperties");
        for (name, field) in fields {
            let at = format!("{at}/{name}");
            match (known.and_then(|known| known.get(name)), other) {
                (Some(schema), _) => self.check(schema, field, &at, faults),
                (None, Some(Value::Bool(false))) => faults.push(format!("{at}: not in the schema")),
                (None, Some(schema)) => self.check(schema, field, &at, faults),
                (None, None) => {}
            }
        }
        let required = words.get("required").map_or(&[][..], list).iter().filter_map(Value::as_str);
        faults.extend(
            required
                .filter(|name| !fields.contains_key(*name))
                .map(|name| format!("{at}/{name}: required by the schema and not there")),
        );
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn is_of(value: &Value, kind: &Value) -> bool {
    match kind.as_str() {
        Some("null") => value.is_null(),
        Some("boolean") => value.is_boolean(),
        Some("string") => value.is_string(),
        Some("number") => value.is_number(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("array") => value.is_array(),
        Some("object") => value.is_object(),
        _ => panic!("this checker does not know the type {kind}"),
    }
}

fn gaps_of(schema: &Value, at: &str, gaps: &mut Vec<String>) {
    if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
        if schema.get("additionalProperties") != Some(&Value::Bool(false)) {
            gaps.push(format!("{at}: allows keys that it does not describe"));
        }
        let kinds = schema.get("anyOf").map_or(&[][..], list).iter().chain([schema]);
        let required: Vec<&Value> =
            kinds.flat_map(|kind| kind.get("required").map_or(&[][..], list)).collect();
        for (name, property) in properties {
            if !required.contains(&&Value::from(name.as_str())) {
                gaps.push(format!("{at}/{name}: may be missing"));
            }
            if property.get("description").is_none() {
                gaps.push(format!("{at}/{name}: has no description"));
            }
        }
    }
    match schema {
        Value::Object(fields) => {
            fields.iter().for_each(|(name, field)| gaps_of(field, &format!("{at}/{name}"), gaps));
        }
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, item)| gaps_of(item, &format!("{at}/{index}"), gaps));
        }
        _ => {}
    }
}
