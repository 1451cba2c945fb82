//! Prints one hash over the transcripts of many seeds, and one for each block of seeds, so that two builds of the protocol
//! can be compared.
//!
//! `events` covers the normalised events alone. `runs` also covers their virtual times, and the end, the violations and
//! the number of messages of each run: it notices what no event shows. Violations are printed as they occur.
//!
//! ```sh
//! cargo run --release -p formation_sim --example fingerprint -- --seeds 10000 --faults mixed
//! cargo run --release -p formation_sim --example fingerprint -- --seeds 10000 --faults mixed --modules 3-12
//! cargo run --release -p formation_sim --example fingerprint -- --show 42 --faults mixed
//! ```

use std::error::Error;

use formation_sim::{CampaignParameters, FaultKind, SeedReport, run_seed};
use sha2::{Digest, Sha256};

/// The number of seeds that share one printed hash, so that a difference can be located.
const BLOCK: u64 = 500;

const USAGE: &str = "usage: fingerprint [--seeds N] [--first-seed N] [--faults KIND] [--modules MIN-MAX] [--show SEED]";

struct Options {
    seeds: u64,
    first_seed: u64,
    faults: FaultKind,
    /// The fewest and the most modules of a drawn scenario; by default those of `tests/faults.rs`.
    modules: Option<(usize, usize)>,
    show: Option<u64>,
}

fn options(mut arguments: impl Iterator<Item = String>) -> Result<Options, Box<dyn Error>> {
    let mut options = Options {
        seeds: 1_000,
        first_seed: 0,
        faults: FaultKind::Mixed,
        modules: None,
        show: None,
    };
    while let Some(option) = arguments.next() {
        let value = arguments.next().ok_or(USAGE)?;
        match option.as_str() {
            "--seeds" => options.seeds = value.parse()?,
            "--first-seed" => options.first_seed = value.parse()?,
            "--faults" => options.faults = value.parse()?,
            "--modules" => {
                let (least, most) = value.split_once('-').ok_or(USAGE)?;
                options.modules = Some((least.parse()?, most.parse()?));
            }
            "--show" => options.show = Some(value.parse()?),
            _ => return Err(USAGE.into()),
        }
    }
    Ok(options)
}

/// Two hashes over all runs so far.
#[derive(Clone, Default)]
struct Fingerprint {
    events: Sha256,
    runs: Sha256,
}

impl Fingerprint {
    fn add(&mut self, report: &SeedReport) {
        for line in report.transcript.lines() {
            self.events.update(&line.event);
            self.events.update("\n");
            self.runs.update(line.at.as_micros().to_le_bytes());
            self.runs.update(&line.event);
        }
        self.events.update("\0");
        let rest = format!(
            "{:?} {:?} {} {} {}",
            report.ending, report.recovery, report.running, report.messages, report.epochs
        );
        self.runs.update(rest);
        for violation in &report.violations {
            self.runs.update(violation.kind.to_string());
        }
    }

    fn print(self, seeds: &str) {
        let hex = |hash: Sha256| -> String {
            let bytes = hash.finalize();
            bytes[..8]
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect()
        };
        println!(
            "{seeds}: events {} runs {}",
            hex(self.events),
            hex(self.runs)
        );
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options(std::env::args().skip(1))?;
    let defaults = CampaignParameters::default();
    let (modules_min, modules_max) = options.modules.unwrap_or(match options.faults {
        FaultKind::Hostile => (defaults.modules_min, 16),
        _ => (defaults.modules_min, defaults.modules_max),
    });
    let parameters = CampaignParameters {
        faults: options.faults,
        modules_min,
        modules_max,
        transcripts: true,
        ..defaults
    };
    if let Some(seed) = options.show {
        print!("{}", run_seed(&parameters, seed)?.transcript);
        return Ok(());
    }
    let mut all = Fingerprint::default();
    let end = options.first_seed + options.seeds;
    let mut first = options.first_seed;
    while first < end {
        let next = end.min(first + BLOCK);
        let mut block = Fingerprint::default();
        for seed in first..next {
            let report = run_seed(&parameters, seed)?;
            for violation in &report.violations {
                println!("seed {seed}: {}: {}", violation.kind, violation.detail);
            }
            block.add(&report);
            all.add(&report);
        }
        block.print(&format!("{} {first}..{next}", options.faults));
        first = next;
    }
    all.print(&format!(
        "{} {}..{end} in all",
        options.faults, options.first_seed
    ));
    Ok(())
}
