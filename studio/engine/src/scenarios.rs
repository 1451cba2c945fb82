//! The scenarios that come with the suite.

use serde::Serialize;

/// A scenario file.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Shipped {
    /// The name of the file, without its extension.
    pub name: &'static str,
    /// Its text.
    pub text: &'static str,
}

macro_rules! shipped {
    ($($path:literal),+ $(,)?) => {
        &[$(Shipped {
            name: $path,
            text: include_str!(concat!("../../../launch_scripts/scenarios/", $path, ".yaml")),
        }),+]
    };
}

/// All of them; a test compares them with the folder.
pub const SHIPPED: &[Shipped] = shipped![
    "figure1_ladder17",
    "singletons_10",
    "two_rooms",
    "case_studies/case_1_ladder",
    "case_studies/case_2_cross",
    "case_studies/case_3_t",
    "case_studies/case_4_snake",
    "case_studies/case_5_quadruped",
    "case_studies/case_6_ring_with_tail",
    "case_studies/case_7_comb",
    "case_studies/case_8_hexapod",
    "mcs_detach",
    "oversupply",
    "paper/eviction_chain",
    "paper/missing_candidate",
    "paper/theorem_1_hole",
    "paper/theorem_1_walled_in",
    "paper/theorem_3_stuck",
    "quadruped_8cm",
    "undersupply",
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    use super::*;

    fn files_of(folder: &Path, prefix: &str, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{prefix}{}", path.file_stem().unwrap().to_str().unwrap());
            if path.is_dir() {
                files_of(&path, &format!("{name}/"), found);
            } else if path
                .extension()
                .is_some_and(|extension| extension == "yaml")
            {
                found.insert(name);
            }
        }
    }

    #[test]
    fn every_shipped_file_is_here() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_scripts/scenarios");
        let mut found = BTreeSet::new();
        files_of(&folder, "", &mut found);
        let here: BTreeSet<String> = SHIPPED.iter().map(|one| one.name.to_owned()).collect();
        assert_eq!(here, found);
    }
}
