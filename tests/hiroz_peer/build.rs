//! Generates the types of the messages from the interface files of the suite, from the standard ones that hiroz ships, and from
//! those in `interfaces`.

use std::collections::{BTreeSet, HashSet};
use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use hiroz_codegen::{GeneratorConfig, MessageGenerator, bundled_assets_dir_for};

/// The standard packages that the suite uses, and those that they use.
const STANDARD: &[&str] = &[
    "action_msgs",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "sensor_msgs",
    "service_msgs",
    "std_msgs",
    "tf2_msgs",
    "unique_identifier_msgs",
    "visualization_msgs",
];

fn main() -> Result<(), Box<dyn Error>> {
    let own = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    let interfaces = own.join("../../msgs");
    println!("cargo:rerun-if-changed={}", interfaces.display());
    let output_dir = PathBuf::from(env::var("OUT_DIR")?);
    let copy = output_dir.join("formation_msgs");
    copy_readable(&interfaces, &copy)?;
    let bundled = bundled_assets_dir_for("jazzy");
    let mut packages: Vec<PathBuf> = STANDARD.iter().map(|name| bundled.join(name)).collect();
    packages.push(copy);
    packages.push(own.join("interfaces/rcl_interfaces"));
    let packages: Vec<&Path> = packages.iter().map(PathBuf::as_path).collect();
    let config = GeneratorConfig {
        generate_cdr: true,
        generate_protobuf: false,
        generate_type_info: true,
        is_humble: false,
        output_dir: output_dir.clone(),
        external_crate: None,
        local_packages: HashSet::new(),
        json_out: None,
    };
    MessageGenerator::new(config).generate_from_msg_files(&packages)?;
    correct_hashes(&output_dir, &interfaces.join("type_hashes.txt"))
}

/// Copies the interfaces. hiroz does not read a bounded string in an action, so the copies of actions have no bounds; these
/// have no bytes on the wire.
fn copy_readable(from: &Path, to: &Path) -> Result<(), Box<dyn Error>> {
    for folder in ["msg", "srv", "action"] {
        fs::create_dir_all(to.join(folder))?;
        for entry in fs::read_dir(from.join(folder))? {
            let path = entry?.path();
            let mut text = fs::read_to_string(&path)?;
            if folder == "action" {
                text = without_bounds(&text);
            }
            let name = path.file_name().ok_or("a file without a name")?;
            fs::write(to.join(folder).join(name), text)?;
        }
    }
    Ok(())
}

fn without_bounds(text: &str) -> String {
    let bound = "string<=";
    let lines = text.lines().map(|line| match line.strip_prefix(bound) {
        Some(bounded) => {
            let rest = bounded.trim_start_matches(|digit: char| digit.is_ascii_digit());
            format!("string{rest}\n")
        }
        None => format!("{line}\n"),
    });
    lines.collect()
}

/// Replaces the hashes that differ from those of the generator of ROS 2, and lists the types that had them, with the hash that
/// hiroz computes, as `CORRECTED_HASHES`. A key with another hash reaches no peer, so that without this nothing of these types
/// could be compared.
fn correct_hashes(output_dir: &Path, hashes: &Path) -> Result<(), Box<dyn Error>> {
    let generated = output_dir.join("generated.rs");
    let mut code = fs::read_to_string(&generated)?;
    let mut corrected = BTreeSet::new();
    for line in fs::read_to_string(hashes)?.lines() {
        let Some((name, hash)) = line.split_once(' ').filter(|_| !line.starts_with('#')) else {
            continue;
        };
        let Some((folder, base)) = name.rsplit_once('/') else {
            continue;
        };
        let dds_name = format!("\"{}::dds_::{base}_\"", folder.replace('/', "::"));
        let mut from = 0;
        while let Some(found) = code[from..].find(&dds_name) {
            from += found + dds_name.len();
            let rest = &code[from..];
            let Some(at) = rest.find("\"RIHS01_") else {
                break;
            };
            // The hash of a type follows its name, unless that of another one comes first.
            if rest[..at].contains("::dds_::") {
                continue;
            }
            let place = from + at + 1..from + at + 1 + hash.len();
            let computed = code[place.clone()].to_owned();
            if computed != hash {
                code.replace_range(place, hash);
                corrected.insert((name.to_owned(), computed));
            }
        }
    }
    fs::write(generated, code)?;
    let list: Vec<&(String, String)> = corrected.iter().collect();
    let list = format!("pub const CORRECTED_HASHES: &[(&str, &str)] = &{list:#?};\n");
    fs::write(output_dir.join("corrected.rs"), list)?;
    Ok(())
}
