//! What the documents name exists: files, items of the code, tests.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use formation_tests::root;

use super::files::{self, TextFile};

/// Every page that is written for people.
fn pages() -> Vec<TextFile> {
    let mut pages = files::all();
    pages.retain(|file| file.ends_with(".md"));
    pages
}

/// The text of a page outside of its fenced blocks.
fn prose(text: &str) -> String {
    text.split("```").step_by(2).collect()
}

/// What a page quotes as code, outside of its fenced blocks.
fn quotes(prose: &str) -> impl Iterator<Item = &str> {
    prose.split('`').skip(1).step_by(2)
}

/// The `file::item` references of a text.
fn references(prose: &str) -> impl Iterator<Item = (&str, &str)> {
    quotes(prose)
        .filter_map(|quoted| quoted.split_once("::"))
        .filter(|(file, _)| file.ends_with(".rs"))
}

/// Whether the source defines an item of this name.
fn defines(source: &str, name: &str) -> bool {
    let kinds = [
        "fn", "struct", "enum", "const", "static", "trait", "type", "mod",
    ];
    let is_name = |symbol: char| symbol.is_alphanumeric() || symbol == '_';
    kinds.iter().any(|kind| {
        let head = format!("{kind} {name}");
        source
            .match_indices(&head)
            .any(|(at, _)| !source[at + head.len()..].starts_with(is_name))
    })
}

/// Whether the source has a test of this name.
fn has_test(source: &str, name: &str) -> bool {
    let header = format!("fn {name}(");
    source.split("#[test]").skip(1).any(|rest| {
        let function = rest
            .lines()
            .find(|line| line.trim_start().starts_with("fn "));
        function.is_some_and(|line| line.contains(&header))
    })
}

/// Whether a reference names a test.
fn is_test((file, name): (&str, &str)) -> bool {
    root().join(file).is_file() && has_test(&TextFile::read(file).text, name)
}

#[test]
fn every_file_that_a_page_names_exists() {
    let top_level = files::top_level();
    let mut missing = Vec::new();
    for page in pages() {
        let prose = prose(&page.text);
        let folder = Path::new(&page.path).parent().unwrap();
        let links = prose
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next())
            .filter(|link| !link.contains("://") && !link.starts_with('#'))
            .map(|link| folder.join(link.split('#').next().unwrap_or(link)));
        let quoted = quotes(&prose)
            .filter_map(|quoted| quoted.split_whitespace().next())
            .filter(|quoted| {
                let top = quoted.split_once('/').map(|(top, _)| top);
                let is_source = [".rs", ".py", ".sh", ".md"]
                    .iter()
                    .any(|end| quoted.ends_with(end));
                top.is_some_and(|top| is_source || top_level.iter().any(|entry| entry == top))
            })
            .map(|quoted| quoted.split("::").next().unwrap_or(quoted))
            .map(|path| match path.split_once('*') {
                Some((folder, _)) => {
                    Path::new(folder.trim_end_matches(|symbol| symbol != '/')).into()
                }
                None => Path::new(path).to_path_buf(),
            });
        for path in links.chain(quoted) {
            if !root().join(&path).exists() {
                missing.push(format!("{} names {}", page.path, path.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

#[test]
fn every_item_that_a_page_names_is_defined_where_it_says() {
    let mut missing = Vec::new();
    for page in pages() {
        for (file, name) in references(&prose(&page.text)) {
            let name = name.rsplit("::").next().unwrap_or(name);
            let exists = root().join(file).is_file();
            if !exists || !defines(&TextFile::read(file).text, name) {
                missing.push(format!("{} names {file}::{name}", page.path));
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

#[test]
fn every_promise_of_the_fault_model_names_tests() {
    let page = TextFile::read("docs/fault_model.md");
    let prose = prose(&page.text);
    let tests: Vec<_> = references(&prose).filter(|one| is_test(*one)).collect();
    assert!(tests.len() > 20, "found {}", tests.len());
}

/// The folder of each crate of the workspace, by name.
fn folders() -> BTreeMap<String, String> {
    let manifest = TextFile::read("Cargo.toml");
    files::table(&manifest.text, "workspace.dependencies")
        .filter_map(|line| {
            let (name, rest) = line.split_once(" = { path = \"")?;
            let (folder, _) = rest.split_once('"')?;
            Some((name.to_owned(), folder.to_owned()))
        })
        .collect()
}

#[test]
fn the_table_of_crates_agrees_with_the_manifests() {
    let page = TextFile::read("ARCHITECTURE.md");
    let crates = page.text.split("\n## Crates\n").nth(1).unwrap();
    let rows = crates.split("\n### ").next().unwrap().lines();
    let listed: BTreeMap<String, BTreeSet<String>> = rows
        .filter(|row| row.starts_with("| `"))
        .map(|row| {
            let cells: Vec<&str> = row.split('|').collect();
            let names = |cell: &str| quotes(cell).map(str::to_owned).collect::<Vec<_>>();
            let folder = names(cells[1]).remove(0);
            (folder, names(cells[2]).into_iter().collect())
        })
        .collect();
    let folders = folders();
    let used: BTreeMap<String, BTreeSet<String>> = files::members()
        .into_iter()
        .map(|member| {
            let manifest = TextFile::read(&format!("{member}/Cargo.toml"));
            let uses = files::table(&manifest.text, "dependencies")
                .filter_map(|line| match line.split_once("path = \"") {
                    Some((_, rest)) => Some(format!("{member}/{}", rest.split_once('"')?.0)),
                    None => folders.get(line.split(['.', ' ']).next()?).cloned(),
                })
                .collect();
            (member, uses)
        })
        .collect();
    assert!(used.len() > 10, "found {used:?}");
    assert_eq!(listed, used);
}

#[test]
fn every_file_of_tests_is_compiled() {
    let mut folders = 0;
    let packages = files::members()
        .into_iter()
        .map(|member| root().join(member));
    let packages: Vec<PathBuf> = packages.collect();
    // A package may have its tests in the folder of another one.
    let mut roots = BTreeSet::new();
    for package in &packages {
        let manifest = fs::read_to_string(package.join("Cargo.toml")).unwrap();
        let paths = manifest
            .lines()
            .filter_map(|line| line.strip_prefix("path = \"")?.strip_suffix('"'));
        roots.extend(paths.filter_map(|path| package.join(path).canonicalize().ok()));
    }
    for package in packages {
        let folder = package.join("tests").canonicalize();
        let of_folder = roots
            .iter()
            .filter(|file| folder.as_deref().ok() == file.parent());
        let texts: Vec<String> = of_folder
            .map(|file| fs::read_to_string(file).unwrap())
            .collect();
        if texts.is_empty() {
            continue;
        }
        folders += 1;
        for file in fs::read_dir(package.join("tests")).unwrap() {
            let file = file.unwrap().path();
            let name = file.file_stem().unwrap().to_str().unwrap();
            let is_compiled = roots.contains(&file.canonicalize().unwrap())
                || texts
                    .iter()
                    .any(|text| text.contains(&format!("mod {name};")));
            assert!(
                is_compiled || file.extension().is_none_or(|extension| extension != "rs"),
                "{} is in no root of tests that a Cargo.toml names",
                file.display()
            );
        }
    }
    assert!(folders >= 6, "only {folders} packages have tests");
}
