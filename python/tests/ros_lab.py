"""What `formation.ros` does, step by step. Prints a line for each.

Usage: ros_lab.py FOLDER_OF_THE_PACKAGE SCENARIO
"""

import sys

sys.path.insert(0, sys.argv[1])

import formation
from formation import ros


def main():
    scenario = formation.Scenario.from_file(sys.argv[2])
    with ros.Formation() as live:
        live.announce(scenario, expected_modules=10)
        seen = set()
        for states in live.follow(timeout_s=60):
            seen |= {state.phase for state in states.values()}
        print("followed to settled" if "settled" in seen else f"followed {seen}", flush=True)
        verdict = live.wait_for_verdict(timeout_s=60)
        agreed = verdict.assignments == formation.plan(scenario).assignments
        print(f"verdict {verdict.outcome} {verdict.filled} of {verdict.spots}{' as planned' if agreed else ''}", flush=True)
        print("added", live.add(11, 20.0, 20.0, agent="modules_1_to_10"), flush=True)
        try:
            live.remove(3)
        except ros.RosError as error:
            print(f"refused to remove: {error}", flush=True)
        try:
            live.add(12, 0.0, 0.0, agent="nobody", timeout_s=1.0)
        except ros.RosError as error:
            print(f"nobody serves: {error}", flush=True)


main()
