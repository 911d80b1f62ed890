//! Definitions of messages, without which viewers cannot read a recording.

use std::collections::BTreeSet;
use std::iter;

/// One after the other, each after its name.
const DEFINITIONS: &str = include_str!("definitions.txt");

/// Length of the line of `=` between the definitions of a schema.
const RULE: usize = 80;

/// The schema of the type `name`, such as `sensor_msgs/msg/Image`: its definition, and those of what it is made of (`ros2msg` in MCAP).
pub(super) fn schema(name: &str) -> String {
    let (mut text, mut known) = (String::new(), BTreeSet::new());
    let mut wanted = vec![name.replace("/msg/", "/")];
    while let Some(name) = wanted.pop() {
        let Some(definition) = definition(&name) else { continue };
        if !text.is_empty() {
            text.extend(iter::repeat_n('=', RULE).chain("\nMSG: ".chars()));
            text += &name;
            text.push('\n');
        }
        text += definition;
        text.push('\n');
        for line in definition.lines() {
            let kind = line.split([' ', '[']).next().unwrap_or_default();
            if kind.contains('/') && known.insert(kind) {
                wanted.push(kind.to_owned());
            }
        }
    }
    text
}

/// Fields of one type, a line each.
fn definition(name: &str) -> Option<&'static str> {
    let mut all = DEFINITIONS.split("MSG: ").filter_map(|text| text.split_once('\n'));
    all.find(|(known, _)| *known == name).map(|(_, fields)| fields.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schemas_bring_all_that_they_are_made_of_once() {
        let text = schema("geometry_msgs/msg/PoseWithCovarianceStamped");
        assert!(text.starts_with("std_msgs/Header header\n"), "{text}");
        for part in ["std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Quaternion"] {
            let rule = "=".repeat(RULE);
            assert_eq!(text.matches(&format!("\n{rule}\nMSG: {part}\n")).count(), 1, "{part}");
        }
        assert!(schema("nothing/msg/Known").is_empty());
    }
}
