//! The authority of a formation, and the certificates that it signs.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DistinguishedName, DnType,
    ExtendedKeyUsagePurpose, IsCa, KeyPair, KeyUsagePurpose, date_time_ymd,
};

/// The common name of the authority.
const AUTHORITY: &str = "formation authority";

/// Clocks of robots may be late by this much when they first use a certificate.
const BACKDATED: Duration = Duration::from_secs(24 * 3_600);

/// Why a certificate could not be made, before the reason.
const CANNOT_SIGN: &str = "cannot make a key or certificate";

const DAY: Duration = Duration::from_secs(24 * 3_600);

/// What a certificate is for.
pub enum Purpose {
    /// A session, which connects to routers.
    Session,
    /// A router with these host names and addresses, which accepts sessions and connects to other routers.
    Router(Vec<String>),
}

/// A certificate and its private key, both in PEM.
pub struct Signed {
    /// The certificate.
    pub certificate: String,
    /// The key.
    pub key: String,
}

/// A certificate authority.
pub struct Authority {
    issuer: CertifiedIssuer<'static, KeyPair>,
    days: u32,
}

impl Authority {
    /// A new authority. Its certificate, and those that it signs, are valid for this many days.
    ///
    /// # Errors
    /// No key can be made, or the clock is wrong.
    pub fn new(days: u32) -> anyhow::Result<Self> {
        let mut parameters = parameters(AUTHORITY, &[], days)?;
        parameters.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        parameters.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        let key = KeyPair::generate().context(CANNOT_SIGN)?;
        let issuer = CertifiedIssuer::self_signed(parameters, key).context(CANNOT_SIGN)?;
        Ok(Self { issuer, days })
    }

    /// Its certificate in PEM.
    pub fn certificate(&self) -> String {
        self.issuer.pem()
    }

    /// Its private key in PEM.
    pub fn key(&self) -> String {
        self.issuer.key().serialize_pem()
    }

    /// Signs a new certificate with this common name.
    ///
    /// # Errors
    /// A host name cannot be in a certificate, or no key can be made.
    pub fn sign(&self, common_name: &str, purpose: &Purpose) -> anyhow::Result<Signed> {
        let names = match purpose {
            Purpose::Session => &[],
            Purpose::Router(names) => names.as_slice(),
        };
        let mut parameters = parameters(common_name, names, self.days)?;
        parameters.use_authority_key_identifier_extension = true;
        parameters.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        parameters.extended_key_usages = match purpose {
            Purpose::Session => vec![ExtendedKeyUsagePurpose::ClientAuth],
            Purpose::Router(_) => vec![
                ExtendedKeyUsagePurpose::ServerAuth,
                ExtendedKeyUsagePurpose::ClientAuth,
            ],
        };
        let key = KeyPair::generate().context(CANNOT_SIGN)?;
        let certificate = parameters
            .signed_by(&key, &self.issuer)
            .context(CANNOT_SIGN)?;
        Ok(Signed {
            certificate: certificate.pem(),
            key: key.serialize_pem(),
        })
    }
}

fn parameters(common_name: &str, names: &[String], days: u32) -> anyhow::Result<CertificateParams> {
    let mut parameters = CertificateParams::new(names.to_vec())
        .with_context(|| format!("no certificate can have the names {}", names.join(", ")))?;
    parameters.distinguished_name = DistinguishedName::new();
    parameters
        .distinguished_name
        .push(DnType::CommonName, common_name);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).context(
        "the clock of this machine is before 1970, so that no certificate would be valid",
    )?;
    let epoch = date_time_ymd(1970, 1, 1);
    parameters.not_before = epoch + now.saturating_sub(BACKDATED);
    parameters.not_after = epoch + now + DAY * days;
    Ok(parameters)
}
