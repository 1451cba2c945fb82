//! What an animated picture holds, read as a browser reads it.

use std::collections::BTreeMap;

use crate::support::Formed;
use formation_generate::{GeneratorParameters, Grouping, generate};
use formation_report::{Colours, animation, course_of_plan};

const OUTCOME: &str = "COMPLETE: all spots are filled, hole-free";
/// Code hosts show larger pictures late or not at all.
const BYTES_MAX: usize = 1_000_000;

fn film(formed: &Formed, colours: Colours) -> String {
    let course = course_of_plan(formed.problem(), &formed.outcome, &formed.motion, 5.0);
    animation(&formed.subject(), &course, OUTCOME, colours)
}

/// The names of the elements, in order; fails where a tag is not closed, or an attribute has no value.
fn elements(xml: &str) -> Vec<&str> {
    let (mut open, mut found) = (Vec::new(), Vec::new());
    for part in xml.split('<').skip(1) {
        let (tag, text) = part.split_once('>').unwrap();
        assert!(!text.contains('>'), "{text}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
            continue;
        }
        let is_empty = tag.ends_with('/');
        let tag = tag.trim_end_matches('/');
        let name = tag.split(' ').next().unwrap();
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        assert_eq!(tag.matches("=\"").count() * 2, tag.matches('"').count());
        found.push(name);
        if !is_empty {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
    found
}

/// The place of each module without animations.
fn drawn(film: &str) -> BTreeMap<u32, String> {
    let modules = film.split("data-module=\"").skip(1);
    let modules = modules.filter_map(|part| {
        let (id, rest) = part.split_once('"')?;
        let (place, _) = rest
            .strip_prefix(" transform=\"translate(")?
            .split_once(')')?;
        Some((id.parse().ok()?, place.to_owned()))
    });
    modules.collect()
}

/// The first and the last place of each module that moves.
fn moved(film: &str) -> BTreeMap<u32, (String, String)> {
    let paths = film.split("@keyframes m").skip(1);
    paths
        .map(|part| {
            let (id, rest) = part.split_once("{0%{transform:translate(").unwrap();
            let (path, _) = rest.split_once("}}").unwrap();
            let place = |text: &str| text.replace("px", "").replace(',', " ");
            let first = place(path.split(')').next().unwrap());
            let (_, last) = path.rsplit_once("to{transform:translate(").unwrap();
            (
                id.parse().unwrap(),
                (first, place(last.trim_end_matches(')'))),
            )
        })
        .collect()
}

#[test]
fn a_film_is_one_well_formed_file_without_scripts_and_references() {
    for colours in [Colours::Light, Colours::Dark] {
        let film = film(&Formed::shipped("figure1_ladder17"), colours);
        let elements = elements(&film);
        assert_eq!(elements[0], "svg");
        assert_eq!(elements.iter().filter(|name| **name == "style").count(), 1);
        assert!(!elements.contains(&"script") && !elements.contains(&"image"));
        for forbidden in ["href", "@import", "http", "onload", "javascript:"] {
            let found = film.replace("http://www.w3.org/2000/svg", "");
            assert!(!found.contains(forbidden), "{forbidden}");
        }
        assert!(film.contains(OUTCOME));
    }
}

#[test]
fn modules_move_from_where_they_start_to_where_they_end() {
    let formed = Formed::shipped("figure1_ladder17");
    let film = film(&formed, Colours::Light);
    let (drawn, moved) = (drawn(&film), moved(&film));
    assert_eq!(drawn.len(), 17);
    assert_eq!(moved.len(), 17, "{moved:?}");
    for (module, (first, last)) in &moved {
        assert_ne!(first, last, "module {module} does not move");
        assert_eq!(last, &drawn[module], "module {module} ends elsewhere");
    }
}

#[test]
fn without_motion_the_end_is_shown() {
    let formed = Formed::shipped("figure1_ladder17");
    let film = film(&formed, Colours::Light);
    let (_, reduced) = film
        .split_once("@media (prefers-reduced-motion: reduce)")
        .unwrap();
    assert!(reduced.starts_with(" { * { animation: none !important; } }"));
    // Whether each element with such a beginning is shown.
    let shown = |beginning: &str| -> Vec<bool> {
        let elements = film.split(beginning).skip(1);
        elements
            .map(|element| !element.split('>').next().unwrap().contains("opacity=\"0\""))
            .collect()
    };
    let captions = shown("class=\"caption\"");
    let (last, others) = captions.split_last().unwrap();
    assert!(last & !others.contains(&true), "{captions:?}");
    let docked = shown("<line id=\"d");
    let docked = docked.iter().filter(|is_shown| **is_shown);
    let edges = formed.problem().target().topology().edges();
    assert_eq!(docked.count(), edges.len());
}

#[test]
fn the_colours_are_those_of_the_page() {
    let formed = Formed::shipped("figure1_ladder17");
    let (light, dark) = (film(&formed, Colours::Light), film(&formed, Colours::Dark));
    for film in [&light, &dark] {
        assert!(!film.contains("prefers-color-scheme"));
    }
    assert!(!light.contains("#1b1f24") && dark.contains("#1b1f24"));
}

#[test]
fn a_film_of_a_hundred_modules_stays_small() {
    let parameters = GeneratorParameters::new(100, 100, 7).grouped(Grouping::Configurations(4));
    let scenario = generate(&parameters).unwrap();
    let formed = Formed::from_scenario(scenario.try_into().unwrap());
    let film = film(&formed, Colours::Dark);
    elements(&film);
    assert!(film.len() < BYTES_MAX, "{} bytes", film.len());
}
