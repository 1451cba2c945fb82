//! Means and standard deviations; medians and ranges.

/// Mean and standard deviation of some numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sample {
    pub mean: f64,
    /// Of the sample, with n - 1 in the denominator; 0 for a single number.
    pub deviation: f64,
    pub count: usize,
}

impl Sample {
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.into_iter().collect();
        let count = values.len();
        if count == 0 {
            return Self::default();
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Self {
            mean,
            deviation: (squares / (count - 1).max(1) as f64).sqrt(),
            count,
        }
    }

    /// The mean with about three significant digits.
    pub(crate) fn short(self) -> String {
        short(self.mean)
    }
}

/// Median and range of few numbers, which may include outliers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spread {
    pub median: f64,
    pub least: f64,
    pub greatest: f64,
}

impl Spread {
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let (Some(&least), Some(&greatest)) = (values.first(), values.last()) else {
            return Self::default();
        };
        let middle = values.len() / 2;
        let median = if values.len() % 2 == 1 {
            values[middle]
        } else {
            f64::midpoint(values[middle - 1], values[middle])
        };
        Self {
            median,
            least,
            greatest,
        }
    }

    /// The median, and the range in brackets.
    pub(crate) fn with_range(self) -> String {
        format!(
            "{} ({} to {})",
            short(self.median),
            short(self.least),
            short(self.greatest)
        )
    }
}

/// A number with at least three digits and at most three decimals.
pub(crate) fn short(value: f64) -> String {
    let decimals = match value.abs() {
        size if !(1e-9..100.0).contains(&size) => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        _ => 3,
    };
    format!("{value:.decimals$}")
}

/// A number for a CSV file, with up to four decimals.
pub(crate) fn exact(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" => "0".to_owned(),
        text => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_and_the_deviation() {
        let sample = Sample::of([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
        assert!((sample.mean - 5.0).abs() < 1e-12);
        assert!((sample.deviation - 2.138_089_935).abs() < 1e-6);
        assert_eq!(Sample::of([3.0]).deviation.to_bits(), 0.0_f64.to_bits());
        assert_eq!(sample.short(), "5.00");
        assert_eq!(exact(0.5), "0.5");
        assert_eq!(exact(-0.000_01), "0");
        assert_eq!(short(1234.5), "1234");
    }

    #[test]
    fn the_median_and_the_range() {
        let spread = Spread::of([126.0, 40.0, 300.0]);
        assert_eq!(spread.with_range(), "126 (40.0 to 300)");
        assert_eq!(
            Spread::of([4.0, 1.0, 2.0, 8.0]).with_range(),
            "3.00 (1.00 to 8.00)"
        );
    }
}
