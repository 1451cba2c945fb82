//! The descriptions of types over which hashes are computed, and the types that ROS 2 derives from services and actions.

use std::collections::{BTreeMap, BTreeSet};

use super::field::{Field, FieldType, fields};

/// The fields of a type.
pub(super) type Description = Vec<Field>;

/// The types that a file defines, by name.
///
/// # Errors
/// Says which line is no field, or which section is missing.
pub(super) fn described(name: &str, text: &str) -> Result<BTreeMap<String, Description>, String> {
    let parts: Vec<&str> = name.split('/').collect();
    let [package, kind, _] = parts.as_slice() else {
        return Err("is not named `package/kind/Name`".to_owned());
    };
    // A separator is a line of its own; it may be the first or the last of the file.
    let mut sections = vec![String::new()];
    for line in text.lines() {
        if line.trim_end() == "---" {
            sections.push(String::new());
        } else if let Some(section) = sections.last_mut() {
            section.push_str(line);
            section.push('\n');
        }
    }
    let sections = sections.iter().map(|section| fields(package, section));
    let sections: Vec<Description> = sections.collect::<Result<_, _>>()?;
    let mut types = BTreeMap::new();
    match (*kind, sections.as_slice()) {
        ("msg", [message]) => {
            types.insert(name.to_owned(), message.clone());
        }
        ("srv", [request, response]) => add_service(&mut types, name, request, response),
        ("action", [goal, result, feedback]) => {
            add_action(&mut types, name, [goal, result, feedback])?;
        }
        (kind, sections) => {
            return Err(format!(
                "is no `{kind}` file, as it has {} sections",
                sections.len()
            ));
        }
    }
    Ok(types)
}

fn add_service(
    types: &mut BTreeMap<String, Description>,
    name: &str,
    request: &[Field],
    response: &[Field],
) {
    let part = |part: &str| format!("{name}_{part}");
    let nested = |name: &str| FieldType::nested(name);
    let whole = ["Request", "Response", "Event"].map(|name| {
        let field = format!("{}_message", name.to_lowercase());
        Field::new(&field, nested(&part(name)))
    });
    let event = vec![
        Field::new("info", nested("service_msgs/msg/ServiceEventInfo")),
        Field::new("request", nested(&part("Request")).at_most_one()),
        Field::new("response", nested(&part("Response")).at_most_one()),
    ];
    types.insert(name.to_owned(), whole.to_vec());
    types.insert(part("Request"), request.to_vec());
    types.insert(part("Response"), response.to_vec());
    types.insert(part("Event"), event);
}

fn add_action(
    types: &mut BTreeMap<String, Description>,
    name: &str,
    [goal, result, feedback]: [&Description; 3],
) -> Result<(), String> {
    let part = |part: &str| format!("{name}_{part}");
    let field = |field: &str, named: &str| Field::new(field, FieldType::nested(&part(named)));
    let id = Field::new(
        "goal_id",
        FieldType::nested("unique_identifier_msgs/msg/UUID"),
    );
    let basic =
        |field: &str, kind: &str| FieldType::parse("", kind).map(|kind| Field::new(field, kind));
    let whole = vec![
        field("goal", "Goal"),
        field("result", "Result"),
        field("feedback", "Feedback"),
        field("send_goal_service", "SendGoal"),
        field("get_result_service", "GetResult"),
        field("feedback_message", "FeedbackMessage"),
    ];
    types.insert(name.to_owned(), whole);
    types.insert(part("Goal"), goal.clone());
    types.insert(part("Result"), result.clone());
    types.insert(part("Feedback"), feedback.clone());
    let stamp = Field::new("stamp", FieldType::nested("builtin_interfaces/msg/Time"));
    let accepted = [basic("accepted", "bool")?, stamp];
    add_service(
        types,
        &part("SendGoal"),
        &[id.clone(), field("goal", "Goal")],
        &accepted,
    );
    let ended = [basic("status", "int8")?, field("result", "Result")];
    add_service(types, &part("GetResult"), std::slice::from_ref(&id), &ended);
    types.insert(
        part("FeedbackMessage"),
        vec![id, field("feedback", "Feedback")],
    );
    Ok(())
}

/// The fields of a type.
///
/// # Errors
/// The type is unknown.
fn find<'a>(
    types: &'a BTreeMap<String, Description>,
    name: &str,
) -> Result<&'a Description, String> {
    types
        .get(name)
        .ok_or_else(|| format!("there is no type `{name}`"))
}

/// The types that a type refers to, and those that these refer to, in the order of their names.
///
/// # Errors
/// Names the type that is unknown.
pub(super) fn referred(
    types: &BTreeMap<String, Description>,
    name: &str,
) -> Result<BTreeSet<String>, String> {
    let nested = |fields: &Description| -> Vec<String> {
        let names = fields.iter().map(|field| field.kind.nested.clone());
        names.filter(|name| !name.is_empty()).collect()
    };
    let mut referred = BTreeSet::new();
    let mut waiting = nested(find(types, name)?);
    while let Some(next) = waiting.pop() {
        if !referred.contains(&next) {
            waiting.extend(nested(find(types, &next)?));
            referred.insert(next);
        }
    }
    Ok(referred)
}

/// The description of a type and of all types that it refers to, in the order of their names, as JSON.
///
/// # Errors
/// Names the type that is unknown.
pub(super) fn full_description(
    types: &BTreeMap<String, Description>,
    name: &str,
) -> Result<String, String> {
    let referred = referred(types, name)?;
    let described = |name: &str| -> Result<String, String> {
        let fields: Vec<String> = find(types, name)?.iter().map(Field::json).collect();
        let fields = fields.join(", ");
        Ok(format!(
            "{{\"type_name\": \"{name}\", \"fields\": [{fields}]}}"
        ))
    };
    let referred = referred.iter().map(|name| described(name));
    let referred: Vec<String> = referred.collect::<Result<_, _>>()?;
    Ok(format!(
        "{{\"type_description\": {}, \"referenced_type_descriptions\": [{}]}}",
        described(name)?,
        referred.join(", ")
    ))
}
