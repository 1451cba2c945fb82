//! Lists of modules, as arguments give them.

use std::collections::BTreeSet;
use std::str::FromStr;

use formation_model::{MODULES_MAX, ModuleId, NO_ID};

/// Modules given as numbers and ranges, such as `1,4,7-9`: ascending, distinct, at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModuleList(Vec<ModuleId>);

impl ModuleList {
    /// The modules in ascending order.
    #[must_use]
    pub fn modules(&self) -> &[ModuleId] {
        &self.0
    }
}

impl FromStr for ModuleList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut modules = BTreeSet::new();
        for part in text.split(',').map(str::trim) {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let (Some(first), Some(last)) = (number(first), number(last)) else {
                return Err(format!(
                    "must list numbers and ranges such as `1,4,7-9`, got `{part}`"
                ));
            };
            if last < first {
                return Err(format!("the range `{part}` runs backwards"));
            }
            if (last - first) as usize >= MODULES_MAX {
                return Err(format!("more than {MODULES_MAX} modules in `{part}`"));
            }
            for id in first..=last {
                if !modules.insert(ModuleId(id)) {
                    return Err(format!("module {id} is listed twice"));
                }
            }
        }
        if modules.len() > MODULES_MAX {
            return Err(format!("more than {MODULES_MAX} modules"));
        }
        Ok(Self(modules.into_iter().collect()))
    }
}

fn number(text: &str) -> Option<u32> {
    text.trim().parse().ok().filter(|&id| id != NO_ID)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(text: &str) -> Result<Vec<u32>, String> {
        let list: ModuleList = text.parse()?;
        Ok(list.modules().iter().map(|module| module.0).collect())
    }

    #[test]
    fn lists_of_modules_take_numbers_and_ranges() {
        assert_eq!(list("1,4,7-9"), Ok(vec![1, 4, 7, 8, 9]));
        assert_eq!(list(" 9 - 9 , 2"), Ok(vec![2, 9]));
        assert_eq!(
            list("5-4"),
            Err("the range `5-4` runs backwards".to_owned())
        );
        assert_eq!(list("1-3,2"), Err("module 2 is listed twice".to_owned()));
        assert!(list("0-4294967294").is_err(), "far too many");
        for bad in ["", "a", "1,,2", "1-", "-1", "4294967295"] {
            assert!(list(bad).unwrap_err().contains("must list"), "{bad}");
        }
    }
}
