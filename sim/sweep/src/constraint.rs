//! Constraints: expressions over settings that hold for every point of a sweep.
//!
//! In order of binding: `||`, `&&`, comparisons, `+ -`, `* / %`, and `! -` before a value. Values are
//! numbers, `true`, `false`, text in quotes, paths of settings, and expressions in parentheses.

use std::cmp::Ordering;

use crate::setting::Setting;

/// Deepest nesting of an expression.
const MAX_DEPTH: usize = 64;

/// An expression over settings that is true or false.
#[derive(Clone, Debug)]
pub(crate) struct Constraint {
    root: Expression,
}

#[derive(Clone, Debug)]
enum Expression {
    Value(Value),
    Setting(String),
    Not(Box<Self>),
    Minus(Box<Self>),
    Both(&'static str, Box<[Self; 2]>),
}

/// A value of a setting or of an expression.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Number(f64),
    Flag(bool),
    Text(String),
}

/// Operators by binding, the weakest first. A longer one comes before one that begins like it.
const OPERATORS: [&[&str]; 5] =
    [&["||"], &["&&"], &["==", "!=", "<=", ">=", "<", ">"], &["+", "-"], &["*", "/", "%"]];

impl Value {
    fn of(text: &str) -> Self {
        match (text.parse(), text.parse()) {
            (Ok(number), _) if f64::is_finite(number) => Self::Number(number),
            (_, Ok(flag)) => Self::Flag(flag),
            _ => Self::Text(text.to_owned()),
        }
    }

    const fn kind(&self) -> &'static str {
        match self {
            Self::Number(_) => "a number",
            Self::Flag(_) => "true or false",
            Self::Text(_) => "text",
        }
    }
}

impl Constraint {
    /// Parses an expression.
    ///
    /// # Errors
    /// In words, with what stands where it ends.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut parser = Parser { rest: text.trim(), depth: 0 };
        let root = parser.expression(0)?;
        match parser.rest {
            "" => Ok(Self { root }),
            rest => Err(format!("an operator such as <= or && has to stand before `{rest}`")),
        }
    }

    /// Paths of the settings in it.
    pub fn paths(&self) -> Vec<&str> {
        self.root.paths()
    }

    /// Whether it holds for a point with `settings`.
    ///
    /// # Errors
    /// In words, if values do not fit their operators.
    pub fn holds(&self, settings: &[&[Setting]]) -> Result<bool, String> {
        match self.root.value(settings)? {
            Value::Flag(flag) => Ok(flag),
            other => Err(format!("it is {}, and has to be true or false: compare it", other.kind())),
        }
    }
}

impl Expression {
    fn paths(&self) -> Vec<&str> {
        match self {
            Self::Value(_) => Vec::new(),
            Self::Setting(path) => vec![path],
            Self::Not(inner) | Self::Minus(inner) => inner.paths(),
            Self::Both(_, both) => both.iter().flat_map(Self::paths).collect(),
        }
    }

    fn value(&self, settings: &[&[Setting]]) -> Result<Value, String> {
        let wrong =
            |operator: &str, value: &Value| Err(format!("`{operator}` does not take {}", value.kind()));
        match self {
            Self::Value(value) => Ok(value.clone()),
            Self::Setting(path) => {
                let found = settings.iter().copied().flatten().find(|setting| *setting.path == **path);
                found.map(|setting| Value::of(&setting.value)).ok_or_else(|| format!("`{path}` has no value"))
            }
            Self::Not(inner) => match inner.value(settings)? {
                Value::Flag(flag) => Ok(Value::Flag(!flag)),
                other => wrong("!", &other),
            },
            Self::Minus(inner) => match inner.value(settings)? {
                Value::Number(number) => Ok(Value::Number(-number)),
                other => wrong("-", &other),
            },
            Self::Both(operator, both) => {
                let [left, right] = &**both;
                let left = left.value(settings)?;
                match (*operator, &left) {
                    ("&&", Value::Flag(false)) | ("||", Value::Flag(true)) => return Ok(left),
                    _ => {}
                }
                combined(operator, left, right.value(settings)?)
            }
        }
    }
}

/// Result of an operator between two values.
fn combined(operator: &str, left: Value, right: Value) -> Result<Value, String> {
    let order = match (&left, &right) {
        (Value::Number(a), Value::Number(b)) => a.partial_cmp(b),
        (Value::Text(a), Value::Text(b)) => (a == b).then_some(Ordering::Equal),
        (Value::Flag(a), Value::Flag(b)) => (a == b).then_some(Ordering::Equal),
        _ => return Err(format!("`{operator}` stands between {} and {}", left.kind(), right.kind())),
    };
    let is_equal = order == Some(Ordering::Equal);
    let value = match (operator, left, right) {
        ("==", ..) => Value::Flag(is_equal),
        ("!=", ..) => Value::Flag(!is_equal),
        // What is short has been answered: the right side decides.
        ("&&" | "||", Value::Flag(_), right) => right,
        ("<", Value::Number(_), _) => Value::Flag(order == Some(Ordering::Less)),
        (">", Value::Number(_), _) => Value::Flag(order == Some(Ordering::Greater)),
        ("<=", Value::Number(_), _) => Value::Flag(order == Some(Ordering::Less) || is_equal),
        (">=", Value::Number(_), _) => Value::Flag(order == Some(Ordering::Greater) || is_equal),
        ("+", Value::Number(a), Value::Number(b)) => Value::Number(a + b),
        ("-", Value::Number(a), Value::Number(b)) => Value::Number(a - b),
        ("*", Value::Number(a), Value::Number(b)) => Value::Number(a * b),
        ("/", Value::Number(a), Value::Number(b)) => Value::Number(a / b),
        ("%", Value::Number(a), Value::Number(b)) => Value::Number(a % b),
        (_, left, _) => return Err(format!("`{operator}` does not take {}", left.kind())),
    };
    match value {
        Value::Number(number) if !number.is_finite() => Err(format!(
            "`{operator}` has no result here, as after a division by 0: leave that out before it, as in `b == 0 || a / b < 2`"
        )),
        value => Ok(value),
    }
}

struct Parser<'a> {
    /// What is left of the text, without blanks before it.
    rest: &'a str,
    depth: usize,
}

impl<'a> Parser<'a> {
    /// Skips `count` bytes and blanks behind them; returns the bytes.
    fn take(&mut self, count: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(count);
        self.rest = rest.trim_start();
        taken
    }

    /// What operators of a binding, and stronger ones, join.
    fn expression(&mut self, binding: usize) -> Result<Expression, String> {
        let Some(operators) = OPERATORS.get(binding) else { return self.value() };
        let mut left = self.expression(binding + 1)?;
        while let Some(operator) = operators.iter().find(|operator| self.rest.starts_with(**operator)) {
            self.take(operator.len());
            let right = self.expression(binding + 1)?;
            left = Expression::Both(operator, Box::new([left, right]));
        }
        Ok(left)
    }

    fn value(&mut self) -> Result<Expression, String> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err("it is nested too deep: write it as several constraints".to_owned());
        }
        let value = match self.rest.chars().next() {
            None => return Err("a value is missing at the end".to_owned()),
            Some('!') => {
                self.take(1);
                Expression::Not(Box::new(self.value()?))
            }
            Some('-') => {
                self.take(1);
                Expression::Minus(Box::new(self.value()?))
            }
            Some('(') => {
                self.take(1);
                let inner = self.expression(0)?;
                if !self.rest.starts_with(')') {
                    return Err("a `)` is missing".to_owned());
                }
                self.take(1);
                inner
            }
            Some(quote @ ('"' | '\'')) => {
                let length = self.rest[1..].find(quote).ok_or_else(|| format!("a `{quote}` is missing"))?;
                let quoted = self.take(length + 2);
                Expression::Value(Value::Text(quoted[1..=length].to_owned()))
            }
            Some(_) => self.word()?,
        };
        self.depth -= 1;
        Ok(value)
    }

    /// A number, `true`, `false` or a path.
    fn word(&mut self) -> Result<Expression, String> {
        let is_inside = |at: usize, letter: char| {
            let is_exponent = "+-".contains(letter)
                && self.rest.starts_with(|first: char| first.is_ascii_digit())
                && self.rest[..at].ends_with(['e', 'E']);
            letter.is_alphanumeric() || "_.".contains(letter) || is_exponent
        };
        let end = self.rest.char_indices().find(|&(at, letter)| !is_inside(at, letter));
        let length = end.map_or(self.rest.len(), |(at, _)| at);
        if length == 0 {
            return Err(format!("a value has to stand before `{}`", self.rest));
        }
        Ok(match Value::of(self.take(length)) {
            Value::Text(path) => Expression::Setting(path),
            value => Expression::Value(value),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn holds(text: &str) -> Result<bool, String> {
        let settings = [("gpu.a", "8"), ("gpu.b", "2.5"), ("flag", "true"), ("timing", "bound")];
        let settings = settings.map(|(path, value)| Setting::new(path, value));
        Constraint::parse(text)?.holds(&[&settings[..2], &settings[2..]])
    }

    #[test]
    fn expressions_have_the_usual_order() {
        for (text, expected) in [
            ("gpu.a <= 8", true),
            ("gpu.a < 8", false),
            ("gpu.a * 2 + 1 == 17 && gpu.b - 1 - 1 == 0.5", true),
            ("2 + 3 * 4 == 14 && (2 + 3) * 4 == 20", true),
            ("gpu.a % 3 == 2 && gpu.a / 4 / 2 == 1", true),
            ("-gpu.a + 8 == 0 && 1e-3*gpu.a==0.008 && 8e+0 >= gpu.a", true),
            ("gpu.a > 100 || flag", true),
            ("!flag || timing != \"bound\"", false),
            ("timing == 'bound' && !(gpu.a != 8)", true),
            ("flag == false", false),
            ("true || timing > 3", true),
            ("gpu.b == 2.5 || gpu.a / (gpu.b - 2.5) > 1", true),
        ] {
            assert_eq!(holds(text), Ok(expected), "{text}");
        }
        assert_eq!(Constraint::parse("gpu.a < x.1.y").unwrap().paths(), ["gpu.a", "x.1.y"]);
    }

    #[test]
    fn wrong_expressions_say_what_is_wrong() {
        for (text, says) in [
            ("", "missing at the end"),
            ("gpu.a <=", "missing at the end"),
            ("gpu.a 3", "before `3`"),
            ("(gpu.a < 3", "a `)` is missing"),
            ("timing == \"bound", "a `\"` is missing"),
            ("gpu.a < , 3", "before `, 3`"),
            ("gpu.a + 1", "compare it"),
            ("timing < 3", "between text and a number"),
            ("timing < 'x'", "`<` does not take text"),
            ("gpu.a && flag", "between a number and true or false"),
            ("!gpu.a", "`!` does not take a number"),
            ("gpu.a / (gpu.b - 2.5) > 1", "division by 0"),
            ("gpu.a % 0 != 1", "division by 0"),
            ("0 / 0 < 1", "division by 0"),
        ] {
            let error = holds(text).unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
        assert!(holds(&"(".repeat(100_000)).unwrap_err().contains("too deep"));
        assert!(holds(&"!".repeat(100_000)).unwrap_err().contains("too deep"));
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in "[gpu.a0-9+*/%<>=!&|()\"' -]{0,60}|\\PC{0,20}") {
            let _ = holds(&text);
        }
    }
}
