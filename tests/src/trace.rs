//! Reads the traces of runs, and judges them by `formation_verify::trace`, which shares nothing with the observer.

use formation_verify::trace::{Trace, TracePoint};
use serde_json::Value;

pub use formation_verify::trace::Overlap;

/// The side of a body, in units.
const WIDTH: f64 = 0.9;

/// All pairs of modules whose bodies overlap at any time.
///
/// # Panics
/// When a line is no state of a module.
#[must_use]
pub fn overlaps(trace: &str) -> Vec<Overlap> {
    formation_verify::trace::overlaps(&read(trace), WIDTH)
}

fn read(trace: &str) -> Trace {
    let mut modules = Trace::new();
    for line in trace.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let number = |key: &str| line[key].as_f64().unwrap();
        let links = line["links"].as_array().unwrap().iter();
        let moment = TracePoint {
            t: number("t"),
            pose: ["x", "y", "theta"].map(number),
            links: links
                .map(|link| u32::try_from(link.as_u64().unwrap()).unwrap())
                .collect(),
        };
        let module = u32::try_from(line["module"].as_u64().unwrap()).unwrap();
        modules.entry(module).or_default().push(moment);
    }
    modules
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(t: f64, module: u64, place: (f64, f64), links: &[u64]) -> String {
        serde_json::json!({
            "t": t, "module": module, "x": place.0, "y": place.1, "theta": 0.0, "links": links, "folding": false,
        })
        .to_string()
    }

    fn judged(lines: &[String]) -> Vec<Overlap> {
        overlaps(&lines.join("\n"))
    }

    #[test]
    fn an_overlap_in_a_trace_is_found_with_modules_time_and_depth() {
        let lines = [
            line(10.0, 7, (0.0, 0.0), &[]),
            line(12.0, 7, (4.0, 0.0), &[]),
            line(9.0, 3, (2.0, 0.5), &[]),
        ];
        let found = judged(&lines);
        let [overlap] = found[..] else {
            panic!("{found:?}");
        };
        assert_eq!(overlap.modules, (3, 7));
        assert!((overlap.depth - 0.4).abs() < 1e-6, "{overlap:?}");
        assert!((10.7..11.3).contains(&overlap.t), "{overlap:?}");
    }

    #[test]
    fn modules_that_pass_in_time_or_are_docked_are_not_found() {
        // The first is gone when the second comes.
        let mut lines = vec![
            line(10.0, 7, (0.0, 0.0), &[]),
            line(11.0, 7, (0.0, 2.0), &[]),
            line(11.0, 3, (-2.0, 0.0), &[]),
            line(12.0, 3, (2.0, 0.0), &[]),
        ];
        assert_eq!(judged(&lines), []);
        lines[1] = line(13.0, 7, (0.0, 2.0), &[]);
        assert_eq!(judged(&lines).len(), 1);
        let lines = [
            line(10.0, 7, (0.0, 0.0), &[5]),
            line(11.0, 7, (2.0, 0.0), &[5]),
            line(9.0, 5, (0.0, 1.0), &[3, 7]),
            line(9.0, 3, (1.0, 0.0), &[5]),
        ];
        assert_eq!(judged(&lines), []);
    }
}
