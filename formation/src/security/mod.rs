//! `formation security create`: an authority, a certificate for each role, and the configuration files of Zenoh with them.

mod certificates;
mod roles;

use std::fs::{DirBuilder, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::Path;

use anyhow::{Context, anyhow};
use ros_runtime::exit::Failure;
use ros_runtime::protection::{Credentials, router_file, session_file};

use crate::arguments::SecurityArguments;
use crate::console;
use crate::role::{ROUTER, Role};
use certificates::{Authority, Purpose};

/// Only the user who creates the files may read them.
const PRIVATE_FILE: u32 = 0o600;
/// Permissions of the directory that holds them.
const PRIVATE_DIRECTORY: u32 = 0o700;

/// Names that every router has, so that a session on its own machine can connect to it.
const OWN_NAMES: [&str; 3] = ["localhost", "127.0.0.1", "::1"];

/// Creates the files.
///
/// # Errors
/// The directory holds files already, a name cannot be in a certificate, or a file cannot be written.
pub fn create(arguments: &SecurityArguments) -> Result<(), Failure> {
    let directory = &arguments.directory;
    let authority = Authority::new(arguments.days).map_err(Failure::BadInput)?;
    let mut names = OWN_NAMES.map(str::to_owned).to_vec();
    names.extend(arguments.router.iter().cloned());
    names.sort();
    names.dedup();
    let routers: Vec<String> = match arguments.router.as_slice() {
        [] => vec![endpoint("localhost", arguments.port)],
        routers => routers
            .iter()
            .map(|router| endpoint(router, arguments.port))
            .collect(),
    };
    let mut files = vec![
        ("authority.pem".to_owned(), authority.certificate()),
        ("authority_key.pem".to_owned(), authority.key()),
    ];
    let namespace = arguments.namespace.to_string();
    let signed = |name: &str, purpose| authority.sign(name, &purpose).map_err(Failure::BadInput);
    let certificate = signed(ROUTER, Purpose::Router(names))?;
    let own = authority.certificate();
    let credentials = Credentials {
        authority: &own,
        certificate: &certificate.certificate,
        key: &certificate.key,
    };
    let rights = Role::ALL.map(|role| role.rights(&namespace));
    let listen = format!("tls/[::]:{}", arguments.port);
    let router = router_file(credentials, &listen, ROUTER, &rights).map_err(Failure::failed)?;
    files.push((format!("{ROUTER}.json5"), router));
    for role in Role::ALL.map(Role::name) {
        let certificate = signed(role, Purpose::Session)?;
        let credentials = Credentials {
            authority: &own,
            certificate: &certificate.certificate,
            key: &certificate.key,
        };
        let session = session_file(credentials, &routers).map_err(Failure::failed)?;
        files.push((format!("{role}.json5"), session));
    }
    write_all(directory, &files).map_err(Failure::BadInput)?;
    for (file, _) in &files {
        console::result_line(&directory.join(file).display().to_string())?;
    }
    Ok(())
}

/// The endpoint of a router; an address of IPv6 stands in brackets.
fn endpoint(host: &str, port: u16) -> String {
    match host.contains(':') {
        true => format!("tls/[{host}]:{port}"),
        false => format!("tls/{host}:{port}"),
    }
}

/// Writes the files into a directory that is new or empty: those of two authorities do not fit together.
fn write_all(directory: &Path, files: &[(String, String)]) -> anyhow::Result<()> {
    let named = || directory.display().to_string();
    DirBuilder::new()
        .recursive(true)
        .mode(PRIVATE_DIRECTORY)
        .create(directory)
        .with_context(|| format!("cannot create {}", named()))?;
    let mut present = directory
        .read_dir()
        .with_context(|| format!("cannot read {}", named()))?;
    if present.next().is_some() {
        return Err(anyhow!(
            "{} holds files already; name a directory that is new or empty",
            named()
        ));
    }
    for (name, text) in files {
        let path = directory.join(name);
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(PRIVATE_FILE)
            .open(&path)
            .and_then(|mut file| file.write_all(text.as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn arguments(directory: &Path, router: &[&str]) -> SecurityArguments {
        SecurityArguments {
            directory: directory.to_owned(),
            router: router.iter().map(|&name| name.to_owned()).collect(),
            port: 7447,
            namespace: "/formation".parse().unwrap(),
            days: 365,
        }
    }

    #[test]
    fn each_role_has_a_private_file_and_an_existing_authority_stays() {
        let parent = tempfile::tempdir().unwrap();
        let directory = parent.path().join("security");
        create(&arguments(&directory, &["10.0.0.1", "fd00::1"])).unwrap();
        for name in Role::ALL.map(Role::name).into_iter().chain([ROUTER]) {
            let path = directory.join(format!("{name}.json5"));
            let mode = fs::metadata(&path).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, PRIVATE_FILE, "{name}");
        }
        let module = fs::read_to_string(directory.join("module.json5")).unwrap();
        assert!(module.contains("tls/10.0.0.1:7447"), "{module}");
        assert!(module.contains("tls/[fd00::1]:7447"), "{module}");
        let authority = fs::read_to_string(directory.join("authority.pem")).unwrap();
        let error = create(&arguments(&directory, &[])).unwrap_err();
        assert!(error.to_string().contains("holds files"), "{error}");
        let kept = fs::read_to_string(directory.join("authority.pem")).unwrap();
        assert_eq!(authority, kept);
    }

    #[test]
    fn a_name_that_no_certificate_can_have_is_refused() {
        let parent = tempfile::tempdir().unwrap();
        let error = create(&arguments(parent.path(), &["r\u{e4}uber"])).unwrap_err();
        assert!(error.to_string().contains("r\u{e4}uber"), "{error}");
    }
}
