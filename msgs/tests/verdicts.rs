//! What the verifier found goes out whole, or says what was left out.

use std::collections::BTreeMap;

use formation_model::{BlockedSpot, Epoch, ModuleId, SpotId};
use formation_msgs as wire;
use formation_msgs::bounds::VIOLATIONS_MAX;
use formation_verify::{Counts, Missing, Outcome, Timings, Verdict, Violation};

fn verdict() -> Verdict {
    Verdict {
        outcome: Outcome::Partial,
        epoch: Some(Epoch {
            number: 2,
            convener: ModuleId(1),
        }),
        filled_spots: 2,
        open_spots: vec![SpotId(7), SpotId(8), SpotId(9)],
        blocked_spots: vec![BlockedSpot {
            spot: SpotId(8),
            module: ModuleId(3),
        }],
        assignments: BTreeMap::from([(ModuleId(1), SpotId(6)), (ModuleId(2), SpotId(5))]),
        unassigned: vec![ModuleId(4)],
        violations: Vec::new(),
        missing: Vec::new(),
        timings: Timings::default(),
        counts: Counts::default(),
        collision_risk: None,
        unjudged: BTreeMap::new(),
    }
}

#[test]
fn a_verdict_goes_out_whole() {
    let sent = wire::Verdict::from(&verdict());
    let selection = |spot_id, module_id| wire::SpotSelection { spot_id, module_id };
    assert_eq!(
        sent,
        wire::Verdict {
            header: wire::Header::default(),
            session: 0,
            epoch: wire::Epoch {
                number: 2,
                convener: 1,
            },
            outcome: wire::Verdict::OUTCOME_PARTIAL,
            filled_spots: 2,
            spots: 5,
            open_spots: vec![7, 8, 9],
            unassigned_modules: vec![4],
            assignments: vec![selection(5, 2), selection(6, 1)],
            blocked_spots: vec![selection(8, 3)],
            collision_free: true,
            collision_reason: String::new(),
            violations: Vec::new(),
        }
    );
    let outcome = |outcome| {
        wire::Verdict::from(&Verdict {
            outcome,
            ..verdict()
        })
        .outcome
    };
    assert_eq!(outcome(Outcome::Complete), wire::Verdict::OUTCOME_COMPLETE);
    assert_eq!(outcome(Outcome::Failed), wire::Verdict::OUTCOME_FAILED);
    let not_judged = wire::Verdict::OUTCOME_NOT_JUDGED;
    assert_eq!(outcome(Outcome::NotJudged), not_judged);
}

#[test]
fn too_many_faults_are_counted() {
    let sent = |missing: u32| {
        wire::Verdict::from(&Verdict {
            outcome: Outcome::Failed,
            violations: vec![Violation::UnknownModule {
                module: ModuleId(3),
            }],
            missing: (0..missing)
                .map(|spot| Missing::Spot { spot: SpotId(spot) })
                .collect(),
            ..verdict()
        })
        .violations
    };
    assert_eq!(
        sent(1),
        ["module 3 is named but takes no part", "spot 0 is empty"]
    );
    let full = sent(255);
    assert_eq!(full.len(), VIOLATIONS_MAX);
    assert_eq!(full[255], "spot 254 is empty");
    let overfull = sent(300);
    assert_eq!(overfull.len(), VIOLATIONS_MAX);
    assert_eq!(overfull[254], "spot 253 is empty");
    // 301 faults, of which 255 stand above.
    assert_eq!(overfull[255], "and 46 more");
}

#[test]
fn a_long_sentence_is_cut_between_characters() {
    let sent = wire::Verdict::from(&Verdict {
        outcome: Outcome::Failed,
        violations: ["", "a", "ab"]
            .map(|start| Violation::RosterInvalid {
                epoch: Epoch {
                    number: 1,
                    convener: ModuleId(1),
                },
                reason: start.to_owned() + &"\u{20ac}".repeat(1_000),
            })
            .into(),
        ..verdict()
    });
    // A character of three bytes leaves up to two bytes free.
    let mut lengths: Vec<usize> = sent.violations.iter().map(String::len).collect();
    lengths.sort_unstable();
    assert_eq!(lengths, [1_022, 1_023, 1_024]);
    assert!(
        sent.violations
            .iter()
            .all(|text| text.ends_with('\u{20ac}'))
    );
}
