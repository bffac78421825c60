//! Plain values, as Python programs and JSON have them.

/// A plain value.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Value {
    /// Explicitly nothing: there is none.
    #[default]
    Null,
    /// A truth value.
    Bool(bool),
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
    /// A list of numbers.
    Numbers(Vec<f64>),
    /// Any other list, and the empty one.
    List(Vec<Value>),
    /// A mapping, in its order.
    Map(Vec<(Key, Value)>),
}

/// A key of a mapping.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// A name.
    One(String),
    /// A pair of names, such as two bodies in contact.
    Pair([String; 2]),
}

impl Value {
    /// Returns a mapping with these entries.
    pub fn map<'k>(entries: impl IntoIterator<Item = (&'k str, Self)>) -> Self {
        let entries = entries
            .into_iter()
            .map(|(key, value)| (Key::One(key.to_owned()), value));
        Self::Map(entries.collect())
    }

    /// Returns a list of texts.
    pub fn texts<'t>(texts: impl IntoIterator<Item = &'t str>) -> Self {
        Self::List(texts.into_iter().map(Self::from).collect())
    }

    /// Returns the kind of the value, for messages.
    pub(crate) fn kind(&self) -> String {
        match self {
            Self::Null => "None".to_owned(),
            Self::Bool(_) => "a truth value".to_owned(),
            Self::Number(_) => "a number".to_owned(),
            Self::Text(_) => "a text".to_owned(),
            Self::Numbers(numbers) => format!("{} numbers", numbers.len()),
            Self::List(values) if values.is_empty() => "an empty list".to_owned(),
            Self::List(values) => format!("a list of {} values", values.len()),
            Self::Map(_) => "a mapping".to_owned(),
        }
    }
}

impl FromIterator<(String, Value)> for Value {
    fn from_iter<I: IntoIterator<Item = (String, Value)>>(entries: I) -> Self {
        let entries = entries.into_iter();
        Self::Map(entries.map(|(key, value)| (Key::One(key), value)).collect())
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<bool> for Value {
    fn from(truth: bool) -> Self {
        Self::Bool(truth)
    }
}

impl<const N: usize> From<[f64; N]> for Value {
    fn from(numbers: [f64; N]) -> Self {
        Self::Numbers(numbers.to_vec())
    }
}
