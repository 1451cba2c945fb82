//! Types of parameters that the core defines.

use formation_model::MicroUnits;
use ros_runtime::parameters::{ParameterValue, Range, ValueType, as_number};

/// A number that the core holds in fixed point, both bounds included.
#[must_use]
pub fn micro_units(value_name: &'static str, from: f64, to: f64) -> ValueType<MicroUnits> {
    let write = |number: &MicroUnits| ParameterValue::Double(number.to_units());
    ValueType::new(value_name, Range::Double { from, to }, write, |value| {
        MicroUnits::from_units(as_number(value)?).ok()
    })
}
