//! Hands push modules at each moment of a formation, and this counts how that ends.
//!
//! A push is whole again if all modules have formed, with no violation, within 120 s of virtual time after the last push.
//!
//! ```sh
//! cargo run --release -p formation_sim --example pushes -- 200
//! ```

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Duration;

use formation_sim::{CampaignParameters, CarryMoment, Ending, FaultKind, run_seed};

/// The time within which a formation is to be whole again.
const WHOLE_WITHIN: Duration = Duration::from_secs(120);

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(Ok(200), |text| text.parse())?;
    let shown: Option<u64> = arguments.next().map(|text| text.parse()).transpose()?;
    let kinds = CarryMoment::ALL.map(|moment| (FaultKind::Carried, Some(moment)));
    for (faults, moment) in kinds.into_iter().chain([(FaultKind::Lost, None)]) {
        let parameters = CampaignParameters {
            faults,
            moment,
            modules_max: 24,
            fault_span: Duration::from_secs(20),
            transcripts: true,
            ..CampaignParameters::default()
        };
        let mut whole = 0;
        let mut slowest = Duration::ZERO;
        let mut left_out = Vec::new();
        let mut violations: BTreeMap<String, Vec<u64>> = BTreeMap::new();
        for seed in shown.map_or(0..seeds, |seed| seed..seed + 1) {
            let report = run_seed(&parameters, seed)?;
            for violation in &report.violations {
                let seeds = violations.entry(violation.kind.to_string()).or_default();
                seeds.push(seed);
            }
            if shown.is_some() {
                println!("{}", report.transcript);
            }
            if report.transcript.events().contains("invalid_start") {
                left_out.push(seed);
            }
            let is_whole = report.ending == Ending::Formed && report.violations.is_empty();
            if is_whole && report.recovery <= WHOLE_WITHIN {
                whole += 1;
                slowest = slowest.max(report.recovery);
            } else {
                println!(
                    "seed {seed}: {:?} after {:?} {:?}",
                    report.ending,
                    report.recovery,
                    report.violations.first()
                );
            }
        }
        println!(
            "{faults} {moment:?}: {whole} of {seeds} whole, at the latest {slowest:?} after; modules left out in {left_out:?}; {violations:?}"
        );
    }
    Ok(())
}
