//! Means and confidence intervals.

/// The mean of some numbers, with the half width of its 95 % confidence interval by Student's t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub count: usize,
    pub mean: f64,
    /// `None` for fewer than two numbers.
    pub half_width: Option<f64>,
}

impl Estimate {
    /// The estimate from a sample; `None` if it is empty.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let half_width = (count > 1).then(|| {
            let deviation = (squares / (count - 1) as f64).sqrt();
            quantile(count - 1) * deviation / (count as f64).sqrt()
        });
        Some(Self {
            count,
            mean,
            half_width,
        })
    }

    /// Mean and half width, with three decimals.
    pub fn text(&self) -> String {
        match self.half_width {
            Some(half_width) => format!("{:.3} ± {half_width:.3}", plain(self.mean)),
            None => format!("{:.3}", plain(self.mean)),
        }
    }
}

/// Zero without a sign.
fn plain(value: f64) -> f64 {
    if value.abs() < 0.000_5 { 0.0 } else { value }
}

/// The 97.5 % quantile of Student's t. For few degrees of freedom from the table, else by the expansion in their inverse
/// (Abramowitz and Stegun, 26.7.5), which is right to three decimals there.
fn quantile(freedom: usize) -> f64 {
    const TABLE: [f64; 12] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179,
    ];
    if let Some(&tabled) = TABLE.get(freedom - 1) {
        return tabled;
    }
    let z: f64 = 1.959_964;
    let n = freedom as f64;
    let first = (z.powi(3) + z) / 4.0;
    let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
    let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
    z + first / n + second / n.powi(2) + third / n.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, tabled) in [
            (1, 12.706),
            (6, 2.447),
            (7, 2.365),
            (10, 2.228),
            (13, 2.160),
            (20, 2.086),
            (30, 2.042),
            (120, 1.980),
            (100_000, 1.960),
        ] {
            let computed = quantile(freedom);
            assert!((computed - tabled).abs() < 0.001, "{freedom}: {computed}");
        }
    }

    #[test]
    fn an_interval_has_students_width() {
        let estimate = Estimate::of(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!(estimate.text(), "3.000 ± 1.963");
        assert_eq!(Estimate::of(&[-0.000_1]).unwrap().text(), "0.000");
        assert_eq!(Estimate::of(&[]), None);
    }
}
