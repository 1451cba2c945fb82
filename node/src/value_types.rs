//! Types of parameters that the core defines.

use formation::model::MicroUnits;
use ros_runtime::parameters::{ParameterValue, Range, ValueType};

/// A number that the core holds in fixed point, both bounds included.
#[must_use]
pub fn micro_units(value_name: &'static str, from: f64, to: f64) -> ValueType<MicroUnits> {
    ValueType::new(
        value_name,
        Range::Double { from, to },
        |number| ParameterValue::Double(number.to_units()),
        |value| match value {
            ParameterValue::Double(number) => MicroUnits::from_units(*number).ok(),
            _ => None,
        },
    )
}
