//! The fields of an interface file.

/// The type of a field, as `type_description_interfaces/msg/FieldType` has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FieldType {
    id: u8,
    capacity: usize,
    string_capacity: usize,
    /// The name of the type that it refers to; empty for a basic type.
    pub nested: String,
}

/// A field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Field {
    name: String,
    pub kind: FieldType,
}

/// The number of a type that is defined by an interface.
const NESTED: u8 = 1;

/// The basic types, with their numbers. `char` is an unsigned byte, as the generator of IDL files writes it.
const BASIC: [(&str, u8); 15] = [
    ("int8", 2),
    ("uint8", 3),
    ("char", 3),
    ("int16", 4),
    ("uint16", 5),
    ("int32", 6),
    ("uint32", 7),
    ("int64", 8),
    ("uint64", 9),
    ("float32", 10),
    ("float64", 11),
    ("bool", 15),
    ("byte", 16),
    ("string", 17),
    ("wstring", 18),
];

/// How much the number of a bounded string exceeds that of an unbounded one.
const BOUNDED_STRING: u8 = 4;
/// How much the number of an array exceeds that of its elements.
const ARRAY: u8 = 48;
/// How much the number of a list with a bound exceeds that of its elements.
const BOUNDED_LIST: u8 = 96;
/// How much the number of a list without a bound exceeds that of its elements.
const LIST: u8 = 144;

impl Field {
    pub(super) fn new(name: &str, kind: FieldType) -> Self {
        Self {
            name: name.to_owned(),
            kind,
        }
    }

    /// The field as JSON, in the form over which the hash is computed.
    pub(super) fn json(&self) -> String {
        let FieldType {
            id,
            capacity,
            string_capacity,
            nested,
        } = &self.kind;
        format!(
            "{{\"name\": \"{}\", \"type\": {{\"type_id\": {id}, \"capacity\": {capacity}, \
             \"string_capacity\": {string_capacity}, \"nested_type_name\": \"{nested}\"}}}}",
            self.name
        )
    }
}

impl FieldType {
    /// The type with this name in the interfaces of `package`, such as `uint8`, `string<=20[]` or `std_msgs/Header[4]`.
    pub(super) fn parse(package: &str, text: &str) -> Result<Self, String> {
        let unknown = || format!("`{text}` is no type");
        let (element, list) = match text.strip_suffix(']') {
            Some(rest) => rest.split_once('[').ok_or_else(unknown)?,
            None => (text, "none"),
        };
        let number = |text: &str| text.parse::<usize>().map_err(|_| unknown());
        let (offset, capacity) = match list {
            "none" => (0, 0),
            "" => (LIST, 0),
            list => match list.strip_prefix("<=") {
                Some(bound) => (BOUNDED_LIST, number(bound)?),
                None => (ARRAY, number(list)?),
            },
        };
        let (name, string_capacity) = match element.split_once("<=") {
            Some((name, bound)) => (name, number(bound)?),
            None => (element, 0),
        };
        let basic = BASIC.iter().find(|(basic, _)| *basic == name);
        let (id, nested) = match basic {
            Some((_, id)) if string_capacity > 0 => (id + BOUNDED_STRING, String::new()),
            Some((_, id)) => (*id, String::new()),
            None => (NESTED, nested_name(package, name).ok_or_else(unknown)?),
        };
        Ok(Self {
            id: id + offset,
            capacity,
            string_capacity,
            nested,
        })
    }

    /// A list of at most one of `self`.
    pub(super) fn at_most_one(mut self) -> Self {
        self.id += BOUNDED_LIST;
        self.capacity = 1;
        self
    }

    /// The type with this full name.
    pub(super) fn nested(name: &str) -> Self {
        Self {
            id: NESTED,
            capacity: 0,
            string_capacity: 0,
            nested: name.to_owned(),
        }
    }
}

/// The full name of a type that a file calls `Name`, `package/Name` or `package/msg/Name`.
fn nested_name(package: &str, name: &str) -> Option<String> {
    let parts: Vec<&str> = name.split('/').collect();
    let is_name = |part: &&str| {
        !part.is_empty()
            && part
                .chars()
                .all(|symbol| symbol.is_ascii_alphanumeric() || symbol == '_')
    };
    if !parts.iter().all(is_name) {
        return None;
    }
    match parts.as_slice() {
        [name] if name.starts_with(char::is_uppercase) => Some(format!("{package}/msg/{name}")),
        [package, name] | [package, "msg", name] => Some(format!("{package}/msg/{name}")),
        _ => None,
    }
}

/// The fields of one section of a file, in order.
pub(super) fn fields(package: &str, text: &str) -> Result<Vec<Field>, String> {
    let lines = text.lines().map(|line| match line.split_once('#') {
        Some((before, _)) => before.trim(),
        None => line.trim(),
    });
    let lines = lines.filter(|line| !line.is_empty());
    let fields = lines.filter_map(|line| {
        let Some((kind, rest)) = line.split_once(char::is_whitespace) else {
            return Some(Err(format!("`{line}` has no name")));
        };
        let rest = rest.trim_start();
        // A constant: one word before `=`. A default value is a second word.
        let constant = rest.split_once('=').map(|(name, _)| name.trim_end());
        if constant.is_some_and(|name| !name.contains(char::is_whitespace)) {
            return None;
        }
        let name = rest.split_whitespace().next().unwrap_or_default();
        Some(FieldType::parse(package, kind).map(|kind| Field::new(name, kind)))
    });
    let fields: Vec<Field> = fields.collect::<Result<_, _>>()?;
    if fields.is_empty() {
        // No structure of IDL is empty, so that the generator adds this field.
        let kind = FieldType::parse(package, "uint8")?;
        return Ok(vec![Field::new(
            "structure_needs_at_least_one_member",
            kind,
        )]);
    }
    Ok(fields)
}
