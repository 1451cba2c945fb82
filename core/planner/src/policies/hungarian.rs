//! The Hungarian method, which `formation_baselines` has. It breaks all links.

use formation_baselines::hungarian;

use super::{AllocationPolicy, OpenInstance};

pub(super) const POLICY: &dyn AllocationPolicy = &Hungarian;

struct Hungarian;

impl AllocationPolicy for Hungarian {
    fn allocate(&self, instance: &OpenInstance) -> Vec<Option<usize>> {
        hungarian::assign(&instance.utilities())
    }

    fn keeps_links(&self) -> bool {
        false
    }
}
