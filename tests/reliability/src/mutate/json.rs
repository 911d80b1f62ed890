//! Changes of JSON values.

use serde_json::{Map, Value, json};

use super::{Dice, text};

/// A changed copy; of what is no JSON, by its words.
pub(super) fn mutated(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let Ok(mut root) = serde_json::from_slice::<Value>(original) else {
        return text::mutated(original, dice);
    };
    if dice.one_in(6) {
        return text::mutated(original, dice);
    }
    let count = count(&root);
    let other = nth(&mut root, &mut dice.below(count)).map(|value| value.clone());
    if let Some(value) = nth(&mut root, &mut dice.below(count)) {
        change(value, other.unwrap_or_default(), dice);
    }
    root.to_string().into_bytes()
}

fn change(value: &mut Value, other: Value, dice: &mut Dice) {
    match (dice.below(4), value) {
        (0, value) => *value = other,
        (1, Value::Array(list)) if !list.is_empty() => {
            let at = dice.below(list.len());
            match dice.below(3) {
                0 => drop(list.remove(at)),
                1 => list.insert(at, other),
                _ => list.extend(vec![list[at].clone(); 1 + dice.below(30)]),
            }
        }
        (1, Value::Object(map)) if !map.is_empty() => {
            let key = map.keys().nth(dice.below(map.len())).cloned().unwrap_or_default();
            let taken = map.remove(&key);
            if dice.one_in(2) {
                map.insert(
                    dice.choose(&["", "0", "1", "4294967296", "-1", "kind"]).to_string(),
                    taken.unwrap_or_default(),
                );
            }
        }
        (2, Value::Number(number)) => {
            let near = number.as_f64().unwrap_or_default();
            *number = match json!(near * [-1.0, 1e3, 1e-3, 1e9, 0.99][dice.below(5)]) {
                Value::Number(changed) => changed,
                _ => return,
            };
        }
        (_, value) => *value = special(dice),
    }
}

fn special(dice: &mut Dice) -> Value {
    let all = [
        Value::Null,
        json!(true),
        json!(0),
        json!(-1),
        json!(1e308),
        json!(1e9),
        json!(1e-308),
        json!(u64::MAX),
        json!(""),
        json!("../hand/hand.urdf"),
        json!([]),
        Value::Object(Map::new()),
        json!([[[[[[0]]]]]]),
    ];
    dice.choose(&all).clone()
}

/// Values in it, itself among them.
fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(list) => list.iter().map(count).sum(),
        Value::Object(map) => map.values().map(count).sum(),
        _ => 0,
    }
}

/// The value that comes after `skipped` others.
fn nth<'a>(value: &'a mut Value, skipped: &mut usize) -> Option<&'a mut Value> {
    if *skipped == 0 {
        return Some(value);
    }
    *skipped -= 1;
    match value {
        Value::Array(list) => list.iter_mut().find_map(|inner| nth(inner, skipped)),
        Value::Object(map) => map.values_mut().find_map(|inner| nth(inner, skipped)),
        _ => None,
    }
}
