//! Whether modules can carry out the allocation that a target gives.

use std::collections::BTreeSet;

use crate::{
    Assignment, GivenAllocation, GivenRefused, ModuleId, PlanningProblem, SpotId, kept_groups,
};

impl PlanningProblem {
    /// Checks that the modules can carry out the allocation that the target gives, if it gives one.
    ///
    /// # Errors
    /// Names the module or the spot, and what is wrong.
    pub fn check_given(&self) -> Result<(), GivenRefused> {
        let Some(given) = self.target().given() else {
            return Ok(());
        };
        self.check_given_modules(given)?;
        self.check_given_number(given)?;
        self.check_given_blocks(given)?;
        self.check_given_joined(given)
    }

    fn check_given_modules(&self, given: &GivenAllocation) -> Result<(), GivenRefused> {
        for Assignment { module, spot } in given.assignments() {
            let position = self.position_of(module);
            let position = position.ok_or(GivenRefused::NoSuchModule(module))?;
            if self.is_cut_off(position) {
                return Err(GivenRefused::Unreachable(module, spot));
            }
            if self.target().position_of(spot).is_none() {
                return Err(GivenRefused::Blocked(module, spot));
            }
        }
        for module in self.modules() {
            let given = given.spots().get(&module.id).copied();
            if let Some(pin) = module.pin.filter(|&pin| given != Some(pin)) {
                return Err(GivenRefused::Settled {
                    module: module.id,
                    pin,
                    given,
                });
            }
        }
        let mut detached = given.detached().iter();
        match detached.find(|&&module| self.position_of(module).is_none()) {
            Some(&module) => Err(GivenRefused::NoSuchDetached(module)),
            None => Ok(()),
        }
    }

    fn check_given_number(&self, given: &GivenAllocation) -> Result<(), GivenRefused> {
        let spots = self.target().spots();
        if self.candidate_count() <= spots.len() {
            let mut modules = self.modules().iter().enumerate();
            let missing = modules.find(|(position, module)| {
                !self.is_cut_off(*position) && !given.spots().contains_key(&module.id)
            });
            return missing.map_or(Ok(()), |(_, module)| Err(GivenRefused::Missing(module.id)));
        }
        let filled: BTreeSet<SpotId> = given.spots().values().copied().collect();
        let empty = spots.iter().find(|spot| !filled.contains(&spot.id));
        empty.map_or(Ok(()), |spot| Err(GivenRefused::Empty(spot.id)))
    }

    /// The modules that stay in a configuration keep links to each other.
    fn check_given_blocks(&self, given: &GivenAllocation) -> Result<(), GivenRefused> {
        for configuration in self.configurations() {
            let members = configuration.modules.into_iter();
            let staying: Vec<ModuleId> = members
                .filter(|member| !given.detached().contains(member))
                .collect();
            if staying.len() < 2 {
                continue;
            }
            if let Some(&module) = staying
                .iter()
                .find(|module| !given.spots().contains_key(module))
            {
                return Err(GivenRefused::Unplaced(module));
            }
            let positions: Vec<usize> = staying
                .iter()
                .filter_map(|&module| self.position_of(module))
                .collect();
            let links = self.links().induced_by(&positions);
            let spot_of = |node: usize| {
                let spot = given.spots().get(&staying[node])?;
                self.target().position_of(*spot)
            };
            let groups = kept_groups(&links, self.target().topology(), spot_of);
            let (Some(first), Some(second)) = (groups.first(), groups.get(1)) else {
                continue;
            };
            let group_of = |node: &usize| groups.iter().position(|group| group.contains(node));
            let torn = links
                .edges()
                .iter()
                .find(|(one, other)| group_of(one) != group_of(other));
            return Err(match torn {
                Some(&(one, other)) => GivenRefused::Torn(staying[one], staying[other]),
                None => GivenRefused::Unlinked(staying[first[0]], staying[second[0]]),
            });
        }
        Ok(())
    }

    fn check_given_joined(&self, given: &GivenAllocation) -> Result<(), GivenRefused> {
        if self.parameters().keep_all_spots {
            return Ok(());
        }
        let target = self.target();
        let spots = given.spots().values();
        let filled: BTreeSet<usize> = spots.filter_map(|&spot| target.position_of(spot)).collect();
        let parts = target
            .topology()
            .components_within(|spot| filled.contains(&spot));
        match (parts.first(), parts.get(1)) {
            (Some(first), Some(second)) => Err(GivenRefused::Apart(
                target.spots()[first[0]].id,
                target.spots()[second[0]].id,
            )),
            _ => Ok(()),
        }
    }
}
