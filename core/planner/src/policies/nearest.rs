//! Greedy by distance, as an example of a policy of one's own.

use super::{AllocationPolicy, OpenInstance};

pub(super) const POLICY: &dyn AllocationPolicy = &Nearest;

struct Nearest;

impl AllocationPolicy for Nearest {
    fn allocate(&self, instance: &OpenInstance) -> Vec<Option<usize>> {
        let mut pairs: Vec<(usize, usize)> = instance.pairs().collect();
        pairs.sort_by_key(|&(module, spot)| (instance.way(module, spot), module, spot));
        let mut spot_of = vec![None; instance.modules().len()];
        let mut taken = vec![false; instance.spots().len()];
        for (module, spot) in pairs {
            if spot_of[module].is_none() && !taken[spot] {
                spot_of[module] = Some(spot);
                taken[spot] = true;
            }
        }
        spot_of
    }
}
