//! Eight small formations like those of the paper's Figure 10.
//!
//! The paper shows its cases only as pictures of its modules, so these cases are ours: initial configurations and
//! singletons that form typical shapes of modular robots.

/// One case study.
pub(crate) struct Case {
    /// The shape that is formed.
    pub name: &'static str,
    /// The text of the scenario file.
    pub scenario: &'static str,
}

macro_rules! case {
    ($name:literal, $file:literal) => {
        Case {
            name: $name,
            scenario: include_str!(concat!(
                "../../launch_scripts/scenarios/case_studies/",
                $file
            )),
        }
    };
}

/// All cases, in the order of their numbers.
pub(crate) const CASES: [Case; 8] = [
    case!("ladder", "case_1_ladder.yaml"),
    case!("cross", "case_2_cross.yaml"),
    case!("T", "case_3_t.yaml"),
    case!("snake", "case_4_snake.yaml"),
    case!("quadruped", "case_5_quadruped.yaml"),
    case!("ring with tail", "case_6_ring_with_tail.yaml"),
    case!("comb", "case_7_comb.yaml"),
    case!("hexapod", "case_8_hexapod.yaml"),
];
