//! Colours that differ for any colour vision, and patterns for further configurations.
//!
//! Seven of the eight colours of M. Okabe and K. Ito, "Color Universal Design" (2008): six for configurations and
//! vermilion for broken links. No meaning depends on colour alone: modules show their number, broken links are dashed.

/// A colour as `#rrggbb`.
pub type Colour = &'static str;

/// Broken links.
pub const BROKEN: Colour = "#d55e00";
/// Modules that belong to no configuration at the start.
pub const SINGLE: Colour = "#d4d4d4";
/// Configurations, in order.
pub const CONFIGURATIONS: [Colour; 6] = [
    "#56b4e9", "#e69f00", "#009e73", "#f0e442", "#0072b2", "#cc79a7",
];
/// Patterns on the colours, each for one round through the colours; the first round is plain.
pub const PATTERNS: [Option<&str>; 4] = [None, Some("stripes"), Some("dots"), Some("checks")];

/// The look of the modules of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// The colour of the body.
    pub fill: Colour,
    /// The colour of the number.
    pub ink: Colour,
    /// The pattern on the body, if any.
    pub pattern: Option<&'static str>,
}

/// The look of the modules of the configuration at this position, or of single modules. Looks repeat after 24
/// configurations.
#[must_use]
pub fn look(configuration: Option<usize>) -> Look {
    let (fill, pattern) = match configuration {
        None => (SINGLE, None),
        Some(position) => (
            CONFIGURATIONS[position % CONFIGURATIONS.len()],
            PATTERNS[position / CONFIGURATIONS.len() % PATTERNS.len()],
        ),
    };
    let ink = if fill == "#0072b2" {
        "#ffffff"
    } else {
        "#000000"
    };
    Look { fill, ink, pattern }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Vector = [f64; 3];

    /// Linear light of each channel.
    fn linear(colour: Colour) -> Vector {
        let channel = |start: usize| {
            let value = u8::from_str_radix(&colour[start..start + 2], 16).unwrap();
            let value = f64::from(value) / 255.0;
            if value <= 0.040_45 {
                value / 12.92
            } else {
                ((value + 0.055) / 1.055).powf(2.4)
            }
        };
        [channel(1), channel(3), channel(5)]
    }

    fn times(matrix: [Vector; 3], vector: Vector) -> Vector {
        matrix.map(|row| {
            row.iter()
                .zip(vector)
                .map(|(factor, value)| factor * value)
                .sum::<f64>()
                .clamp(0.0, 1.0)
        })
    }

    /// CIE L*a*b* of linear sRGB, white point D65.
    fn lab(rgb: Vector) -> Vector {
        let xyz = times(
            [
                [0.412_456, 0.357_576, 0.180_438],
                [0.212_673, 0.715_152, 0.072_175],
                [0.019_334, 0.119_192, 0.950_304],
            ],
            rgb,
        );
        let [x, y, z] = [xyz[0] / 0.950_47, xyz[1], xyz[2] / 1.088_83].map(|value| {
            if value > 0.008_856 {
                value.cbrt()
            } else {
                7.787 * value + 16.0 / 116.0
            }
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// Full dichromacy after G. Machado, M. Oliveira and L. Fernandes, "A Physiologically-based Model for Simulation
    /// of Color Vision Deficiency" (2009): protan, deutan, tritan.
    const DEFICIENCIES: [[Vector; 3]; 3] = [
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
        [
            [1.255_528, -0.076_749, -0.178_779],
            [-0.078_411, 0.930_809, 0.147_602],
            [0.004_733, 0.691_367, 0.303_900],
        ],
    ];

    #[test]
    fn colours_differ_for_every_colour_vision() {
        let colours: Vec<Colour> = CONFIGURATIONS.into_iter().chain([SINGLE, BROKEN]).collect();
        let unchanged = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for deficiency in DEFICIENCIES.into_iter().chain([unchanged]) {
            let seen: Vec<Vector> = colours
                .iter()
                .map(|&colour| lab(times(deficiency, linear(colour))))
                .collect();
            for (index, one) in seen.iter().enumerate() {
                for (other_index, other) in seen.iter().enumerate().skip(index + 1) {
                    let difference: f64 = one
                        .iter()
                        .zip(other)
                        .map(|(one, other)| (one - other).powi(2))
                        .sum::<f64>()
                        .sqrt();
                    assert!(
                        difference > 10.0,
                        "{} and {} differ by {difference:.1} only",
                        colours[index],
                        colours[other_index]
                    );
                }
            }
        }
    }

    #[test]
    fn numbers_on_modules_are_legible() {
        let luminance = |colour| {
            let [red, green, blue] = linear(colour);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        for configuration in (0..CONFIGURATIONS.len()).map(Some).chain([None]) {
            let look = look(configuration);
            let (one, other) = (luminance(look.fill), luminance(look.ink));
            let contrast = (one.max(other) + 0.05) / (one.min(other) + 0.05);
            assert!(contrast > 4.5, "{}: {contrast:.1}", look.fill);
        }
    }

    #[test]
    fn twenty_four_configurations_look_different() {
        let looks: Vec<Look> = (0..24).map(|position| look(Some(position))).collect();
        for (index, one) in looks.iter().enumerate() {
            assert!(!looks[index + 1..].contains(one));
        }
    }
}
