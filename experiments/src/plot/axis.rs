//! Axes: where a value lies on them, and where their ticks are.

use super::Series;

/// The upper edge of a vertical axis is at least this many times the greatest value, so that curves stay clear of it.
pub(super) const HEADROOM: f64 = 1.02;

/// One axis.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    /// From 0 to a round number above the greatest value.
    FromZero,
    /// From the least to the greatest value, both rounded.
    Around,
    /// Logarithmic, from power to power of ten.
    Logarithmic,
    /// From 0 to 100.
    Percent,
    /// One place a name.
    Names(Vec<String>),
}

/// An axis that knows its range. Places are what is drawn: values, or their logarithms.
#[derive(Clone, Debug)]
pub(crate) struct Scale {
    pub from: f64,
    pub to: f64,
    pub ticks: Vec<(f64, String)>,
    logarithmic: bool,
}

impl Axis {
    pub(crate) fn from_zero(label: &str) -> Self {
        Self::of(label, Kind::FromZero)
    }

    pub(crate) fn around(label: &str) -> Self {
        Self::of(label, Kind::Around)
    }

    pub(crate) fn logarithmic(label: &str) -> Self {
        Self::of(label, Kind::Logarithmic)
    }

    pub(crate) fn percent(label: &str) -> Self {
        Self::of(label, Kind::Percent)
    }

    /// Value 0 is at the first name, 1 at the second, and so on.
    pub(crate) fn names(label: &str, names: Vec<String>) -> Self {
        Self::of(label, Kind::Names(names))
    }

    fn of(label: &str, kind: Kind) -> Self {
        Self {
            label: label.to_owned(),
            kind,
        }
    }

    /// The range and the ticks for series whose values along this axis `value` gives, with their deviations. A range that
    /// is not set reaches to `headroom` times the greatest value at least.
    pub(crate) fn scale(
        &self,
        series: &[Series],
        headroom: f64,
        value: impl Fn(&super::Point) -> (f64, f64),
    ) -> Scale {
        let all = || series.iter().flat_map(|one| &one.points).map(&value);
        let least = all().map(|(v, _)| v).fold(f64::INFINITY, f64::min);
        let greatest = all().map(|(v, _)| v).fold(f64::NEG_INFINITY, f64::max);
        let (least, greatest) = if least <= greatest {
            (least, greatest)
        } else {
            (0.0, 1.0)
        };
        let highest = all().map(|(v, d)| v + d).fold(greatest, f64::max);
        let lowest = all().map(|(v, d)| v - d).fold(least, f64::min);
        match &self.kind {
            Kind::Percent => linear(0.0, 100.0, 20.0),
            Kind::FromZero => {
                let highest = if highest > 0.0 { highest } else { 1.0 };
                let step = step_for(highest);
                let steps = (highest * headroom / step - 1e-9).ceil().max(1.0);
                linear(0.0, steps * step, step)
            }
            Kind::Around => {
                let step = step_for(if highest > lowest {
                    highest - lowest
                } else {
                    1.0
                });
                let (from, to) = ((lowest / step).floor(), (highest / step).ceil());
                linear(from * step, to.max(from + 1.0) * step, step)
            }
            Kind::Logarithmic => decades(least, highest * headroom),
            Kind::Names(names) => Scale {
                from: -0.5,
                to: names.len() as f64 - 0.5,
                ticks: names
                    .iter()
                    .enumerate()
                    .map(|(place, name)| (place as f64, name.clone()))
                    .collect(),
                logarithmic: false,
            },
        }
    }
}

impl Scale {
    /// Where a value lies, within the range.
    pub(crate) fn place(&self, value: f64) -> f64 {
        let place = if self.logarithmic {
            value.max(f64::MIN_POSITIVE).log10()
        } else {
            value
        };
        place.clamp(self.from, self.to)
    }

    /// The name of the tick at a place.
    pub(crate) fn name(&self, place: f64) -> String {
        let near = |tick: &&(f64, String)| (tick.0 - place).abs() < (self.to - self.from) * 1e-6;
        let tick = self.ticks.iter().find(near);
        tick.map(|tick| tick.1.clone()).unwrap_or_default()
    }
}

/// A step of 1, 2 or 5 times a power of ten, of which some four to eight make up `span`.
fn step_for(span: f64) -> f64 {
    let rough = span / 6.0;
    let power = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|&step| step >= rough)
        .unwrap_or(10.0 * power)
}

fn linear(from: f64, to: f64, step: f64) -> Scale {
    let mut ticks = Vec::new();
    let mut place = from;
    while place <= to + step * 1e-6 {
        ticks.push((place, number(place, step)));
        place += step;
    }
    Scale {
        from,
        to,
        ticks,
        logarithmic: false,
    }
}

fn decades(least: f64, greatest: f64) -> Scale {
    let from = least.max(1e-9).log10().floor();
    let to = greatest.max(1e-9).log10().ceil().max(from + 1.0);
    let mut ticks = Vec::new();
    let mut place = from;
    while place <= to + 1e-6 {
        let value = 10_f64.powf(place);
        ticks.push((place, number(value, value)));
        place += 1.0;
    }
    Scale {
        from,
        to,
        ticks,
        logarithmic: true,
    }
}

/// A number as precise as its step, thousands kept apart.
fn number(value: f64, step: f64) -> String {
    let value = if value.abs() < step * 1e-6 {
        0.0
    } else {
        value
    };
    let decimals = (0..9)
        .find(|&decimals| {
            let scaled = step * 10_f64.powi(decimals);
            (scaled - scaled.round()).abs() < 1e-6 * scaled
        })
        .unwrap_or(9);
    let text = format!("{value:.*}", usize::try_from(decimals).unwrap_or_default());
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let (sign, digits) = match whole.strip_prefix('-') {
        Some(digits) => ("-", digits),
        None => ("", whole),
    };
    let mut grouped = String::new();
    for (position, digit) in digits.chars().enumerate() {
        if position > 0 && (digits.len() - position) % 3 == 0 && digits.len() > 4 {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    format!("{sign}{grouped}{rest}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::{Look, Point};

    fn series(values: &[f64]) -> Vec<Series> {
        vec![Series {
            name: String::new(),
            look: Look::stated(),
            points: values.iter().map(|&y| Point::new(0.0, y)).collect(),
        }]
    }

    fn names(axis: &Axis, values: &[f64]) -> Vec<String> {
        let scale = axis.scale(&series(values), HEADROOM, |point| {
            (point.y, point.deviation)
        });
        scale.ticks.into_iter().map(|tick| tick.1).collect()
    }

    #[test]
    fn ticks_are_round_and_span_the_values() {
        let axis = Axis::from_zero("x");
        assert_eq!(names(&axis, &[3.0, 9.3]), ["0", "2", "4", "6", "8", "10"]);
        let bare = axis.scale(&series(&[10.0, 100.0]), 1.0, |point| (point.y, 0.0));
        assert_eq!(bare.name(bare.to), "100");
        assert_eq!(
            names(&axis, &[950_000.0]),
            ["0", "200,000", "400,000", "600,000", "800,000", "1,000,000"]
        );
        assert_eq!(
            names(&axis, &[0.0]).first().map(String::as_str),
            Some("0.0")
        );
        let axis = Axis::around("x");
        assert_eq!(
            names(&axis, &[-0.31, 0.12]),
            ["-0.4", "-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2"]
        );
        let axis = Axis::logarithmic("x");
        assert_eq!(
            names(&axis, &[0.02, 300.0]),
            ["0.01", "0.1", "1", "10", "100", "1000"]
        );
    }

    #[test]
    fn a_value_lies_where_its_tick_is() {
        let scale =
            Axis::logarithmic("x").scale(&series(&[1.0, 1000.0]), 1.0, |point| (point.y, 0.0));
        assert_eq!(scale.name(scale.place(100.0)), "100");
        assert_eq!(scale.name(scale.place(200.0)), "");
    }
}
