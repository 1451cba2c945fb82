//! The documents as a book: every page is in it, and every link leads somewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use formation_tests::root;

use super::files::{self, TextFile};

/// The part of a page that is neither a fenced block nor quoted code.
fn text_of(page: &str) -> String {
    let prose: String = page.split("```").step_by(2).collect();
    prose.split('`').step_by(2).collect()
}

/// Where links of a text lead: what stands in `](...)`, and in `src` and `srcset` of pictures.
fn links(text: &str) -> Vec<String> {
    let markdown = text
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next());
    let pictures = ["src=\"", "srcset=\""].into_iter().flat_map(|attribute| {
        let found = text.split(attribute).skip(1);
        found.filter_map(|rest| rest.split('"').next())
    });
    let links = markdown.chain(pictures).map(str::to_owned);
    links.filter(|link| !link.contains("://")).collect()
}

/// The anchors of a page: its headings as code hosts and mdbook name them.
fn anchors(page: &str) -> BTreeSet<String> {
    let outside = page.split("```").step_by(2);
    let headings = outside.flat_map(str::lines);
    let headings = headings.filter_map(|line| {
        let heading = line.trim_start_matches('#');
        (heading.len() < line.len()).then(|| heading.strip_prefix(' '))?
    });
    headings
        .map(|heading| {
            let kept = heading.trim().chars().filter_map(|symbol| match symbol {
                ' ' => Some('-'),
                '-' | '_' => Some(symbol),
                _ if symbol.is_alphanumeric() => Some(symbol.to_ascii_lowercase()),
                _ => None,
            });
            kept.collect()
        })
        .collect()
}

/// A path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            other => plain.push(other),
        }
    }
    plain
}

fn pages() -> BTreeMap<PathBuf, TextFile> {
    let pages = files::all()
        .into_iter()
        .filter(|file| file.ends_with(".md"));
    pages
        .map(|page| (PathBuf::from(&page.path), page))
        .collect()
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let pages = pages();
    let mut broken = Vec::new();
    for (path, page) in &pages {
        for link in links(&text_of(&page.text)) {
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match file {
                "" => path.clone(),
                _ => normal(&path.parent().unwrap().join(file)),
            };
            let page = pages.get(&target);
            let has_anchor =
                anchor.is_empty() || page.is_some_and(|page| anchors(&page.text).contains(anchor));
            if !root().join(&target).exists() || !has_anchor {
                broken.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// A page of the book cannot link to what is not in the book.
#[test]
fn the_book_has_every_page_and_links_within_itself() {
    let summary = TextFile::read("docs/SUMMARY.md");
    let listed: BTreeSet<PathBuf> = links(&summary.text)
        .into_iter()
        .map(|link| Path::new("docs").join(link))
        .collect();
    let mut wrong = Vec::new();
    for (path, page) in pages().iter().filter(|(path, _)| path.starts_with("docs")) {
        if !listed.contains(path) && !path.ends_with("SUMMARY.md") {
            wrong.push(format!("docs/SUMMARY.md lacks {}", path.display()));
        }
        for link in links(&text_of(&page.text)) {
            let file = link.split('#').next().unwrap_or_default();
            let target = normal(&path.parent().unwrap().join(file));
            if !target.starts_with("docs") {
                wrong.push(format!("{}: {link} leads out of the book", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn anchors_are_those_of_code_hosts() {
    let page =
        "# One, two\n```sh\n# no heading\n```\n## `formation run`\n### What *grows*, and how\n";
    let wanted = ["one-two", "formation-run", "what-grows-and-how"];
    assert_eq!(anchors(page), wanted.map(str::to_owned).into());
}
