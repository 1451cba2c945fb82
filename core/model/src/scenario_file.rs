//! The text of scenario files: targets and modules are listed, or drawn as maps.

use serde::Deserialize;

use crate::map::{Lattice, Map, Undrawable, draw};
use crate::scenario::NESTING_MAX;
use crate::yaml;
use crate::{
    BodyShape, FieldError, MICRO_PER_UNIT, PlannerParameters, Pose, RawArea, RawConfiguration,
    RawGiven, RawGivenSpot, RawModule, RawScenario, RawSpot, RawTarget, Scenario, ScenarioError,
};

/// A scenario file as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScenarioFile {
    #[serde(default)]
    name: String,
    target: TargetSection,
    modules: Option<ModulesSection>,
    #[serde(default)]
    configurations: Vec<RawConfiguration>,
    #[serde(default)]
    singletons: Vec<RawModule>,
    #[serde(default)]
    planner: PlannerParameters,
    module_size: Option<f64>,
    #[serde(default)]
    body: BodyShape,
    body_width: Option<f64>,
    #[serde(default)]
    obstacles: Vec<RawArea>,
    arena: Option<RawArea>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetSection {
    frame_id: Option<String>,
    spots: Option<Vec<RawSpot>>,
    edges: Option<Vec<[u32; 2]>>,
    map: Option<String>,
    origin: Option<[f64; 2]>,
    pitch: Option<f64>,
    ids: Option<Vec<u32>>,
    allocation: Option<Vec<RawGivenSpot>>,
    detached: Option<Vec<u32>>,
    #[serde(default)]
    in_parts: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModulesSection {
    map: String,
    origin: Option<[f64; 2]>,
    pitch: Option<f64>,
    ids: Option<Vec<u32>>,
}

fn lattice(
    field: &str,
    origin: Option<[f64; 2]>,
    pitch: Option<f64>,
) -> Result<Lattice, FieldError> {
    let pitch = pitch.unwrap_or(1.0);
    if !(pitch.is_finite() && pitch > 0.0) {
        let reason = format!("{pitch} is no positive number of units");
        return Err(FieldError::new(format_args!("{field}.pitch"), reason));
    }
    let origin = origin.unwrap_or_default();
    Ok(Lattice { origin, pitch })
}

impl TargetSection {
    /// Who takes which spot, if the section says so.
    fn given(&mut self) -> Result<Option<RawGiven>, FieldError> {
        match (self.allocation.take(), self.detached.take()) {
            (Some(allocation), detached) => Ok(Some(RawGiven {
                allocation,
                detached: detached.unwrap_or_default(),
            })),
            (None, Some(_)) => {
                let reason = "belongs to `allocation`, which is missing";
                Err(FieldError::new("target.detached", reason))
            }
            (None, None) => Ok(None),
        }
    }

    /// The target, and the walls in its map.
    fn listed(self) -> Result<(RawTarget, Vec<RawArea>), FieldError> {
        let frame_id = self.frame_id.unwrap_or_else(|| "map".to_owned());
        let mut walls = Vec::new();
        let (spots, edges) = match (self.spots, self.map) {
            (Some(spots), None) => {
                if self.origin.is_some() || self.pitch.is_some() || self.ids.is_some() {
                    let reason = "`origin`, `pitch` and `ids` belong to `map`";
                    return Err(FieldError::new("target", reason));
                }
                (spots, self.edges.unwrap_or_default())
            }
            (None, Some(map)) => {
                if self.edges.is_some() {
                    return Err(FieldError::new("target.edges", "the map has them"));
                }
                let lattice = lattice("target", self.origin, self.pitch)?;
                let map = Map::read("target", &map)?;
                let (spots, edges) = map.target(lattice, self.ids.as_deref())?;
                walls = map.walls("target", lattice, &spots)?;
                (spots, edges)
            }
            (Some(_), Some(_)) => {
                return Err(FieldError::new("target", "has both `spots` and `map`"));
            }
            (None, None) => return Err(FieldError::new("target", "needs `spots` or `map`")),
        };
        let target = RawTarget {
            frame_id,
            spots,
            edges,
        };
        Ok((target, walls))
    }
}

/// Refuses deeply nested brackets, on which the parser takes time in the square of their number.
///
/// Quoted text counts as well: a name with more than [`NESTING_MAX`] open brackets is refused.
fn check_nesting(text: &str) -> Result<(), ScenarioError> {
    let mut depth = 0_usize;
    for (line, content) in text.lines().enumerate() {
        let mut previous = ' ';
        for (column, character) in content.chars().enumerate() {
            match character {
                '#' if previous.is_whitespace() => break,
                '[' | '{' => depth += 1,
                ']' | '}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth > NESTING_MAX {
                return Err(ScenarioError::TooDeep {
                    line: line + 1,
                    column: column + 1,
                });
            }
            previous = character;
        }
    }
    Ok(())
}

impl TryFrom<ScenarioFile> for RawScenario {
    type Error = FieldError;

    fn try_from(file: ScenarioFile) -> Result<Self, FieldError> {
        let mut section = file.target;
        let given = section.given()?;
        let in_parts = section.in_parts;
        let (target, walls) = section.listed()?;
        let mut obstacles = file.obstacles;
        obstacles.extend(walls);
        let (mut configurations, mut singletons) = (file.configurations, file.singletons);
        if let Some(drawn) = file.modules {
            if !(configurations.is_empty() && singletons.is_empty()) {
                let reason = "has a map, so `configurations` and `singletons` must be left out";
                return Err(FieldError::new("modules", reason));
            }
            let mut lattice = lattice("modules", drawn.origin, drawn.pitch)?;
            let map = Map::read("modules", &drawn.map)?;
            // Within walls there may be no room beside the target.
            if drawn.origin.is_none() && file.arena.is_none() && !map.has_walls() {
                lattice = map.clear_of(&target.spots, lattice);
            }
            (configurations, singletons) = map.modules(lattice, drawn.ids.as_deref())?;
            obstacles.extend(map.walls("modules", lattice, &target.spots)?);
        }
        Ok(Self {
            name: file.name,
            target,
            configurations,
            singletons,
            planner: file.planner,
            module_size: file.module_size,
            body: file.body,
            body_width: file.body_width,
            obstacles,
            arena: file.arena,
            given,
            in_parts,
        })
    }
}

impl RawScenario {
    /// Reads the text of a scenario file. Maps become lists; what they say is not yet checked.
    ///
    /// # Errors
    /// Names the line of a syntax error, or what is wrong with a map.
    pub fn from_yaml(text: &str) -> Result<Self, ScenarioError> {
        check_nesting(text)?;
        let file: ScenarioFile = yaml::read(text)?;
        Ok(Self::try_from(file)?)
    }
}

impl Scenario {
    /// Reads and validates the text of a scenario file.
    ///
    /// # Errors
    /// Names the line of a syntax error, or the field that is wrong and why.
    pub fn from_yaml(text: &str) -> Result<Self, ScenarioError> {
        Self::try_from(RawScenario::from_yaml(text)?)
    }

    /// The sections `target` and `modules` of a scenario file that draws this scenario. Headings are not drawn, which on a
    /// lattice of squares makes no difference, and every configuration has the leader that is chosen by default.
    ///
    /// # Errors
    /// Names what does not stand on a lattice of pitch 1, or is docked to something that is not next to it.
    pub fn to_maps(&self) -> Result<String, FieldError> {
        let problem = self.problem();
        let target = problem.target();
        let spots = target.spots();
        let names: Vec<String> = spots.iter().map(|spot| spot.id.to_string()).collect();
        let placed = placed("target", spots.iter().map(|spot| ('o', spot.pose)), &names)?;
        let ids: Vec<u32> = spots.iter().map(|spot| spot.id.0).collect();
        let edges = target.topology().edges();
        let mut text = section("target", &placed, edges, &ids, &names)?;
        if let Some(given) = target.given() {
            text.push_str(&given.to_raw().to_yaml());
        }
        if target.topology().components().len() > 1 {
            text.push_str("  in_parts: true\n");
        }

        let modules = problem.modules();
        let mut letters = ('A'..='Z').cycle();
        let mut letter_of = std::collections::BTreeMap::new();
        let letters: Vec<char> = modules
            .iter()
            .map(|module| match module.configuration {
                Some(configuration) => *letter_of
                    .entry(configuration)
                    .or_insert_with(|| letters.next().unwrap_or('A')),
                None => 's',
            })
            .collect();
        let names: Vec<String> = modules.iter().map(|module| module.id.to_string()).collect();
        let poses = letters
            .into_iter()
            .zip(modules.iter().map(|module| module.pose));
        let placed = self::placed("modules", poses, &names)?;
        let ids: Vec<u32> = modules.iter().map(|module| module.id.0).collect();
        let links = problem.links();
        text.push_str(&section("modules", &placed, links.edges(), &ids, &names)?);
        Ok(text)
    }
}

/// A quarter turn, in millionths of a radian.
const QUARTER_TURN: i64 = 1_570_796;

/// The positions of what is drawn; each must be turned by quarter turns.
fn placed(
    field: &str,
    poses: impl Iterator<Item = (char, Pose)>,
    names: &[String],
) -> Result<Vec<(char, f64, f64)>, FieldError> {
    let mut placed = Vec::new();
    for ((letter, pose), name) in poses.zip(names) {
        let rest = pose.theta.0.rem_euclid(QUARTER_TURN);
        if rest.min(QUARTER_TURN - rest) > MICRO_PER_UNIT / 10_000 {
            let reason = format!("{name} is not turned by a multiple of a quarter turn");
            return Err(FieldError::new(field, reason));
        }
        placed.push((letter, pose.x.to_units(), pose.y.to_units()));
    }
    Ok(placed)
}

fn section(
    field: &str,
    placed: &[(char, f64, f64)],
    docks: &[(usize, usize)],
    ids: &[u32],
    names: &[String],
) -> Result<String, FieldError> {
    if placed.is_empty() {
        return Ok(String::new());
    }
    let (map, [x, y], order) = draw(placed, docks).map_err(|undrawable| {
        let reason = match undrawable {
            Undrawable::OffLattice(one) => {
                format!("{} stands off the lattice of {}", names[one], names[0])
            }
            Undrawable::Shared(one, other) => {
                format!("{} and {} stand on one place", names[one], names[other])
            }
            Undrawable::FarDock(one, other) => {
                let (one, other) = (&names[one], &names[other]);
                format!("{one} and {other} are docked, but not side by side")
            }
        };
        FieldError::new(field, reason)
    })?;
    let mut text = format!("{field}:\n  origin: [{x:?}, {y:?}]\n");
    let drawn: Vec<u32> = order.iter().map(|&at| ids[at]).collect();
    if !drawn.iter().copied().eq((1..).take(drawn.len())) {
        text.push_str(&format!("  ids: {drawn:?}\n"));
    }
    // YAML takes the indentation of a first line that begins with a space for that of all, unless a number states it.
    let is_indented = map.starts_with(' ');
    text.push_str(if is_indented {
        "  map: |2\n"
    } else {
        "  map: |\n"
    });
    for line in map.lines() {
        text.push_str(if line.is_empty() { "" } else { "    " });
        text.push_str(line);
        text.push('\n');
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAWN: &str = "
name: drawn
target:
  origin: [3.0, 2.0]
  map: |
    o-o   o-o
    |     |
    o-o-o-o
modules:
  origin: [0.0, 8.0]
  map: |
    A-A   s   s
    |
    A   B-B   s
    |
    A
";

    #[test]
    fn drawn_and_listed_scenarios_are_the_same() {
        let scenario = Scenario::from_yaml(DRAWN).unwrap();
        assert_eq!(scenario.problem().target().spots().len(), 8);
        assert_eq!(scenario.problem().modules().len(), 9);
        let text = scenario.to_maps().unwrap();
        let again = Scenario::from_yaml(&format!("name: drawn\n{text}")).unwrap();
        assert_eq!(again, scenario);
    }

    #[test]
    fn modules_drawn_without_an_origin_stand_beside_the_target() {
        let places = |text: &str| -> Vec<(f64, f64)> {
            let scenario = Scenario::from_yaml(text).unwrap();
            let modules = scenario.problem().modules().iter();
            modules
                .map(|module| (module.pose.x.to_units(), module.pose.y.to_units()))
                .collect()
        };
        let on_it = "{target: {map: \"o-o\\n|\\no\"}, modules: {map: \"A-A\\n\\ns\"}}";
        assert_eq!(places(on_it), [(0.0, -2.0), (1.0, -2.0), (0.0, -3.0)]);
        // A target elsewhere leaves them where a map lies by default.
        let apart = "{target: {map: 'o-o', origin: [5, 5]}, modules: {map: 'A-A'}}";
        assert_eq!(places(apart), [(0.0, 0.0), (1.0, 0.0)]);
        let placed = "{target: {map: 'o-o'}, modules: {map: 'A-A', origin: [0, 0]}}";
        assert_eq!(places(placed), [(0.0, 0.0), (1.0, 0.0)]);
        let listed = "{target: {spots: [{id: 1, x: 0.5, y: 0.5}]}, modules: {map: 's', pitch: 2}}";
        assert_eq!(places(listed), [(0.5, -1.5)]);
    }

    #[test]
    fn walls_are_drawn_with_modules_and_spots() {
        let listed = "{target: {spots: [{id: 1, x: 2, y: 0}]}, singletons: [{id: 1, x: 0, y: 0}], \
                      obstacles: [{x: 1, y: 0.5, width: 1, height: 2}, {x: 2, y: 1, width: 1, height: 1}]}";
        let drawn = "target: {spots: [{id: 1, x: 2, y: 0}]}\nmodules:\n  map: |\n    . ###\n      #\n    A #\n";
        let [listed, drawn] = [listed, drawn].map(|text| Scenario::from_yaml(text).unwrap());
        assert_eq!(listed.problem(), drawn.problem());
        assert_eq!(
            listed.problem().target().surroundings().obstacles().len(),
            2
        );
    }

    #[test]
    fn a_section_has_one_of_the_two_forms() {
        for (text, expected) in [
            (
                "target: {map: 'o', spots: []}",
                "target: has both `spots` and `map`",
            ),
            ("target: {frame_id: map}", "target: needs `spots` or `map`"),
            (
                "target: {map: 'o', edges: []}",
                "target.edges: the map has them",
            ),
            (
                "target: {spots: [{id: 1, x: 0, y: 0}], pitch: 2}",
                "target: `origin`, `pitch` and `ids` belong to `map`",
            ),
            (
                "target: {map: 'o', pitch: 0}",
                "target.pitch: 0 is no positive number of units",
            ),
            (
                "{target: {map: 'o'}, modules: {map: 'A'}, singletons: [{id: 1, x: 0, y: 0}]}",
                "modules: has a map, so `configurations` and `singletons` must be left out",
            ),
        ] {
            assert_eq!(
                Scenario::from_yaml(text).unwrap_err().to_string(),
                expected,
                "{text}"
            );
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_named() {
        let turned = "{target: {map: 'o'}, singletons: [{id: 4, x: 0, y: 0, theta: 0.3}]}";
        let refused = Scenario::from_yaml(turned).unwrap().to_maps().unwrap_err();
        assert_eq!(
            refused.to_string(),
            "modules: module 4 is not turned by a multiple of a quarter turn"
        );
        let off = "{target: {map: 'o'}, singletons: [{id: 4, x: 0, y: 0}, {id: 5, x: 0.5, y: 0}]}";
        let refused = Scenario::from_yaml(off).unwrap().to_maps().unwrap_err();
        assert_eq!(
            refused.to_string(),
            "modules: module 5 stands off the lattice of module 4"
        );
    }
}
