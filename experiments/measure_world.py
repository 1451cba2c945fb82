#!/usr/bin/env python3
"""Forms scenarios in the physical world at several values of slip and noise, and prints success, time and contacts.

    cargo build --release && python3 experiments/measure_world.py [--runs 20] [--slip 0.2] [--noise 0.01] [--csv FILE]

Each value of --slip is combined with each of --noise, and each pair is run --runs times: with Figure 1 of the paper, and with
30 modules that start alone, whose scenario has another seed in each run. The seed of the world is the number of the run.
"""

import argparse
import csv
import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENARIOS = ("figure1", "singles30")
COLUMNS = (
    "scenario", "slip", "noise", "run", "verdict", "filled", "spots", "acting_ms", "contacts", "contacts_above_touch",
    "fastest_contact", "deepest_overlap", "docking_attempts", "docking_failures", "replanned", "reason",
)


def scenario_file(formation, name, run, folder):
    """The file of a scenario in its n-th run."""
    if name == "figure1":
        return ROOT / "launch_scripts" / "scenarios" / "figure1_ladder17.yaml"
    command = [formation, "generate", "--modules", "30", "--spots", "30", "--seed", str(run)]
    generated = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    path = Path(folder) / f"singles30_{run}.yaml"
    path.write_text(generated, encoding="utf-8")
    return path


def form(options, name, slip, noise, run, folder):
    """One run, as a row of the table."""
    command = [
        options.formation, "run", str(scenario_file(options.formation, name, run, folder)), "--json", "--world",
        "--slip", str(slip), "--noise", str(noise), f"--world-option=--seed={run}",
        "--modules-per-process", str(options.modules_per_process), "--timeout", str(options.timeout),
    ]
    if options.domain is not None:
        command += ["--domain", str(options.domain)]
    finished = subprocess.run(command, capture_output=True, text=True)
    row = {"scenario": name, "slip": slip, "noise": noise, "run": run}
    if not finished.stdout.strip():
        lines = finished.stderr.strip().splitlines() or ["no output"]
        return row | {"verdict": "NONE", "reason": lines[-1]}
    report = json.loads(finished.stdout)
    row |= {key: report["world"][key] for key in COLUMNS if key in report.get("world", {})}
    row |= {key: report[key] for key in ("verdict", "acting_ms", "replanned")}
    row["filled"] = len(report["assignments"])
    row["spots"] = row["filled"] + len(report["open_spots"])
    reasons = [report["collision_reason"]] + report["violations"] + (report["missing"] or [])
    row["reason"] = next((reason for reason in reasons if reason), "")
    return row


def summary(rows):
    """One row of the printed table for all runs of a pair of values."""
    complete = [row for row in rows if row["verdict"] == "COMPLETE"]
    filled = sum(row.get("filled", 0) == row.get("spots", -1) for row in rows)
    times = [row["acting_ms"] / 1000 for row in complete]
    time = f"{statistics.median(times):.0f} s (to {max(times):.0f} s)" if times else ""

    def total(key):
        return sum(row.get(key, 0) for row in rows)

    first = rows[0]
    fastest = max(row.get("fastest_contact", 0.0) for row in rows)
    return (
        f"| {first['scenario']} | {first['slip']} | {first['noise']} | {len(complete)} of {len(rows)} | {filled} of {len(rows)} "
        f"| {time} | {total('contacts')} | {total('contacts_above_touch')} | {fastest:.2f} |"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--formation", default=str(ROOT / "target" / "release" / "formation"), help="the launcher")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--slip", type=float, nargs="+", default=[0.2])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.01])
    parser.add_argument("--scenario", choices=SCENARIOS, nargs="+", default=SCENARIOS)
    parser.add_argument("--modules-per-process", type=int, default=4)
    parser.add_argument("--timeout", type=float, default=120.0, help="seconds for each run")
    parser.add_argument("--domain", type=int)
    parser.add_argument("--csv", type=Path, help="append every run to this file")
    options = parser.parse_args()
    print("| scenario | slip | noise | COMPLETE | all spots filled | acting, median | contacts | above a touch | fastest |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.scenario:
            for slip in options.slip:
                for noise in options.noise:
                    numbers = range(1, options.runs + 1)
                    rows = [form(options, name, slip, noise, run, folder) for run in numbers]
                    print(summary(rows), flush=True)
                    if options.csv:
                        append(options.csv, rows)


def append(path, rows):
    """Adds rows to a file, with a heading if it is new."""
    is_new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
        if is_new:
            writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    sys.exit(main())
