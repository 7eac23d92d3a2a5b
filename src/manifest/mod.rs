//! What was run, and files that are either whole or absent.
//!
//! In: facts handed over by the harness.
//! Out: [`RunKey`] (what makes two sets of numbers comparable), [`Manifest`] (what made them), checksums,
//! the file operations that keep finished work safe: [`write_file`], [`seal`] and [`unseal`]; and settings as they are
//! written: [`SettingsFile`].
//! Nothing here knows a motion, a metric or a physics engine.

mod durable;
mod seal;
mod settings_file;

pub use durable::write_file;
pub use seal::{SealError, seal, unseal};
pub use settings_file::{SettingsFile, SettingsFileError};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Version of this program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// SHA-256 of some bytes as 64 lower-case hexadecimal digits.
#[must_use]
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// Bytes as lower-case hexadecimal digits.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    let digit = |nibble: u8| char::from_digit(u32::from(nibble), 16).unwrap_or('0');
    bytes.iter().flat_map(|byte| [digit(byte >> 4), digit(byte & 15)]).collect()
}

/// What must be equal before two numbers of the same metric and case may be compared.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunKey {
    /// Version of this program.
    pub rprae: String,
    /// Physics engine with its version.
    pub engine: String,
    /// What computed the numbers; `cpu`.
    pub device: String,
    /// Every setting that changes a number, as `name:value` pairs joined by `|`.
    pub signature: String,
}

impl RunKey {
    /// What differs from `other`, one line a field, this key first; empty when the keys are equal.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        [
            ("rprae", &self.rprae, &other.rprae),
            ("engine", &self.engine, &other.engine),
            ("device", &self.device, &other.device),
            ("signature", &self.signature, &other.signature),
        ]
        .into_iter()
        .filter(|(_, ours, theirs)| ours != theirs)
        .map(|(name, ours, theirs)| format!("{name}: {}", signature_difference(ours, theirs)))
        .collect()
    }
}

/// How a signature differs from another: only those of its parts, joined by `|`, that the other has not, and the other way round.
#[must_use]
pub fn signature_difference(ours: &str, theirs: &str) -> String {
    let parts_of = |text: &str, other: &str| {
        let others: Vec<&str> = other.split('|').collect();
        let own: Vec<&str> = text.split('|').filter(|part| !others.contains(part)).collect();
        if own.is_empty() { "nothing".to_owned() } else { own.join("|") }
    };
    format!("{} is not {}", parts_of(ours, theirs), parts_of(theirs, ours))
}

/// An input that was used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UsedInput {
    /// Identity of the case.
    pub id: String,
    /// Where it was read.
    pub source: String,
    /// Checksum of the checked numbers (body, rate, frames), not of the file around them.
    pub motion_sha256: String,
}

/// An input that was not used, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkippedInput {
    /// Identity the case would have had.
    pub id: String,
    /// Where it was read.
    pub source: String,
    /// One line that names the place and the reason.
    pub reason: String,
}

/// In one line: what it is, where it is, why it is skipped.
impl std::fmt::Display for SkippedInput {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { id, source, reason } = self;
        write!(formatter, "{id} ({source}): {reason}")
    }
}

/// The record of a run, beside its results.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// What makes the numbers comparable.
    pub key: RunKey,
    /// Checksum of the program that ran, so that two builds of one version can be told apart.
    pub program_sha256: String,
    /// Operating system and processor family, for example `linux x86_64`.
    pub platform: String,
    /// Name of the processor as the system gives it; `unknown` where it gives none.
    pub processor: String,
    /// Where the motions came from.
    pub dataset: String,
    /// Inputs that were used, in case order.
    pub inputs: Vec<UsedInput>,
    /// Inputs that were not used.
    pub skipped: Vec<SkippedInput>,
}

/// Operating system and processor family.
#[must_use]
pub fn platform() -> String {
    format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)
}

/// Name of the processor as the system gives it; `unknown` where it gives none.
#[must_use]
pub fn processor() -> String {
    std::fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        })
        .unwrap_or_else(|| "unknown".to_owned())
}

/// Checksum of the running program; `unknown` where it cannot be read.
#[must_use]
pub fn program_sha256() -> String {
    // Tens of megabytes, and asked for more than once in a run.
    static CHECKSUM: std::sync::OnceLock<String> = std::sync::OnceLock::new();
    let checksum = || {
        std::env::current_exe()
            .and_then(std::fs::read)
            .map_or_else(|_| "unknown".to_owned(), |bytes| sha256_hex(&bytes))
    };
    CHECKSUM.get_or_init(checksum).clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key() -> RunKey {
        RunKey {
            rprae: "0.1.0".to_owned(),
            engine: "rapier 0.36.1".to_owned(),
            device: "cpu".to_owned(),
            signature: "dt:1/480".to_owned(),
        }
    }

    #[test]
    fn sha256_is_the_published_one() {
        // FIPS 180-2, appendix B.1.
        assert_eq!(sha256_hex(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    #[test]
    fn keys_name_what_differs() {
        let other = RunKey { signature: "dt:1/240".to_owned(), ..key() };
        assert_eq!(key().differences(&key()), Vec::<String>::new());
        assert_eq!(key().differences(&other), ["signature: dt:1/480 is not dt:1/240"]);
    }

    #[test]
    fn long_signatures_are_shortened_to_what_differs() {
        let (ours, theirs) = ("dt:1/480s|pgs:8|assist:20bw|sole:on", "dt:1/240s|pgs:8|assist:0.2bw");
        assert_eq!(
            signature_difference(ours, theirs),
            "dt:1/480s|assist:20bw|sole:on is not dt:1/240s|assist:0.2bw"
        );
        assert_eq!(signature_difference("a:1|b:2", "a:1"), "b:2 is not nothing");
    }
}
