"""Solves instances of the CG:SHOP Challenge 2021 and has the contest's own checker judge the solutions.

Prints for each instance the seconds, and how many times longer than the bound the solution takes: the most steps that any robot
needs when it is alone. Solves those in a folder, as the contest publishes them (NAME.instance.json), or without one draws some
of the same kinds. Ends with an error if an instance of at most 300 robots is not solved within 60 s.

Usage: measure_cgshop.py [ROBOTS_MAX [FOLDER]]
"""

import json
import pathlib
import statistics
import sys
import tempfile
import time

import cgshop2021_pyutils as contest
import formation
from cgshop2021_pyutils.instance import InstanceReader
from cgshop2021_pyutils.solution.solution_reader import SolutionReader
from formation.benchmarks import KINDS, draw

#: Widths of fields, and shares of their free cells.
DRAWN = [(10, 0.2), (10, 0.6), (10, 0.9), (20, 0.3), (20, 0.6), (20, 0.9), (30, 0.3), (30, 0.9), (45, 0.4)]
ROBOTS_SURE = 300
SECONDS_SURE = 60.0


def drawn(folder):
    for kind in KINDS:
        for width, share in DRAWN:
            instance = draw(kind, width, share, 1)
            (folder / f"{instance['name']}.instance.json").write_text(json.dumps(instance))


def solve(path):
    """The seconds, the steps and their bound of a solution that the checker accepts; a reason instead, if there is none."""
    begun = time.perf_counter()
    plan = formation.plan(formation.Scenario.import_cgshop(path))
    try:
        solution = plan.cgshop_solution()
    except formation.PlanError as error:
        return str(error)
    seconds = time.perf_counter() - begun
    instance = InstanceReader().from_json_file(str(path))
    try:
        contest.validate(SolutionReader({instance.name: instance}).from_json_obj(solution))
    except RuntimeError as error:
        return f"the contest's checker refuses it: {error}"
    return seconds, plan.makespan, plan.makespan_bound


def main():
    robots_max = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else made)
        if len(sys.argv) <= 2:
            drawn(folder)
        paths = folder.rglob("*.instance.json")
        sized = sorted((len(json.loads(path.read_text())["starts"]), path) for path in paths)
        rows = {True: [], False: []}
        for robots, path in sized:
            if robots > robots_max:
                continue
            answer = solve(path)
            rows[robots <= ROBOTS_SURE].append(answer)
            shown = answer
            if not isinstance(answer, str):
                shown = f"{answer[0]:.2f} s, {answer[1]} steps, {answer[1] / max(1, answer[2]):.2f} times the bound"
            print(f"{path.name.removesuffix('.instance.json')}: {robots} robots: {shown}", flush=True)
    for is_sure, words in ((True, f"at most {ROBOTS_SURE}"), (False, f"{ROBOTS_SURE + 1} to {robots_max}")):
        solved = [answer for answer in rows[is_sure] if not isinstance(answer, str)]
        line = f"{words} robots: {len(solved)} of {len(rows[is_sure])} solved and accepted"
        if solved:
            ratios = sorted(steps / max(1, bound) for _, steps, bound in solved)
            longest = max(seconds for seconds, _, _ in solved)
            middle = statistics.median(ratios)
            line += f", {longest:.1f} s at most; {middle:.2f} times the bound in the median, {ratios[-1]:.2f} at most"
        print(line)
    late = [answer for answer in rows[True] if isinstance(answer, str) or answer[0] > SECONDS_SURE]
    sys.exit(1 if late else 0)


main()
