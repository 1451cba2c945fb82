//! Eight small formations in the spirit of the paper's Figure 10.
//!
//! The paper shows its cases as pictures of its own modules, so these are ours: initial configurations and singletons
//! into shapes that modular robots take.

/// One case study.
pub(crate) struct Case {
    /// What is formed.
    pub name: &'static str,
    /// The scenario file.
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
