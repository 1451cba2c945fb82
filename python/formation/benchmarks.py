"""Comparisons with public solvers: one table for each problem, and no ranking over all.

    python -m formation.benchmarks [assignment] [subgraph] [motion] [--seeds N] [--json FILE]

Each answer is judged by :mod:`formation.neutral_check`, which shares nothing with the planner. A row is a quantity of which
less is better, or more for what is named so; those in which ours is behind come first. What is not installed is named:
``numpy`` and ``scipy`` solve assignments, ``rdkit`` common subgraphs, ``rt-lacam`` motion.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import json
import math
import os
import platform
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any
from collections.abc import Callable, Iterable, Iterator, Mapping

from . import neutral_check
from ._instances import KINDS, draw
from .plans import Plan, plan
from .scenarios import Scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["KINDS", "TABLES", "as_neutral", "assignment", "draw", "motion", "subgraph"]

#: How often both sides compute an answer of which the shortest time counts.
_ROUNDS = 3
#: Free cells round the field for solvers that need a bounded grid.
_MARGIN = 4


def as_neutral(made: Plan) -> tuple[dict[str, Any], dict[str, Any]]:
    """The instance and the result of a plan in the format of ``docs/neutral_format.md``.

    Without configurations the times are those of the plan, in steps; with some, those of simulated drives, in seconds, and a step
    of a block that folds takes as long as any other, so no speed is judged.
    """
    known = json.loads(made.scenario._native.instance_json())
    fields = made.scenario.to_dict()
    known["body"] = fields.get("body", "square")
    known["given"] = fields["target"].get("allocation")
    whole = made.to_dict()
    result: dict[str, Any] = {"format": 1, "allocation": whole["assignments"]}
    paths = whole["motion"].get("modules", [])
    if not paths:
        return known, result
    if any(module["links"] for module in known["modules"]):
        known["max_speed"] = None
        moments: dict[int, dict[float, list[float]]] = {}
        docked = {(module["id"], other): None for module in known["modules"] for other in module["links"]}
        for row in made.trace():
            moments.setdefault(row["module"], {})[row["t"]] = [row["x"], row["y"], row["theta"], row["t"]]
            for one, other in [pair for pair, until in docked.items() if pair[0] == row["module"] and until is None]:
                if other not in row["links"]:
                    docked[one, other] = row["t"]
        # Each end says so in a message of its own; the links end with the later.
        both = {(one, other): (until, docked[other, one]) for (one, other), until in docked.items() if one < other}
        result["docked"] = [[*pair, None if None in ends else max(ends)] for pair, ends in both.items()]
        result["motion"] = [{"module": module, "waypoints": list(points.values())} for module, points in moments.items()]
    else:
        result["motion"] = [{"module": path["module"], "waypoints": _with_rests(path["waypoints"])} for path in paths]
    return known, result


def _with_rests(waypoints: Sequence[Sequence[float]]) -> list[list[float]]:
    """A module rests until one step before it is at its next waypoint."""
    points = [list(waypoints[0])]
    for point in waypoints[1:]:
        if point[3] - points[-1][3] > 1:
            points.append([*points[-1][:3], point[3] - 1])
        points.append(list(point))
    return points


Row = dict[str, Any]


def _row(task: str, quantity: str, ours: float, theirs: float, peer: str, note: str = "", more: bool = False) -> Row:
    worse, better = (theirs, ours) if more else (ours, theirs)
    ratio = None if not better else worse / better
    return {"task": task, "quantity": quantity, "ours": ours, "theirs": theirs, "peer": peer, "behind": ratio, "note": note}


def _judged(verdict: Mapping[str, Any]) -> str:
    return "valid" if verdict["valid"] else f"{len(verdict['violations'])} violations: {verdict['violations'][0]}"


def _timed(run: Callable[[], Any], rounds: int = 1) -> tuple[Any, float]:
    """The answer, and the shortest of so many times in seconds."""
    times = []
    for _ in range(rounds):
        begun = time.perf_counter()
        answer = run()
        times.append(time.perf_counter() - begun)
    return answer, min(times)


def _planned(scenario: Scenario) -> tuple[Plan, float]:
    """A plan, and the shortest of the times that its allocation takes, in seconds."""
    plans = [plan(scenario) for _ in range(_ROUNDS)]
    return plans[-1], min(made.numbers["planning_us"] for made in plans) / 1e6


def _pairs(spot_of: Mapping[int, int]) -> dict[str, Any]:
    return {"allocation": [{"module": module, "spot": spot} for module, spot in sorted(spot_of.items())]}


def assignment(seeds: Iterable[int], sizes: Iterable[int] = (30, 100, 300)) -> Iterator[Row]:
    """Single modules to spots by the sum of utilities, against SciPy's ``linear_sum_assignment``."""
    from scipy.optimize import linear_sum_assignment

    for size in sizes:
        for seed in seeds:
            scenario = Scenario.generate(size, size, seed=seed).with_planner(spread=0.0)
            utilities = scenario.utilities
            made, ours_s = _planned(scenario)
            (rows, columns), theirs_s = _timed(
                lambda matrix=utilities: linear_sum_assignment(matrix, maximize=True), _ROUNDS
            )
            modules, spots = scenario.module_ids, scenario.spot_ids
            theirs = {modules[row]: spots[column] for row, column in zip(rows.tolist(), columns.tolist())}
            known, ours = as_neutral(made)
            del ours["motion"]
            verdicts = [neutral_check.judge(known, result) for result in (ours, _pairs(theirs))]
            note = f"ours {_judged(verdicts[0])}, SciPy's {_judged(verdicts[1])}"
            costs = [
                -math.fsum(float(utilities[modules.index(module), spots.index(spot)]) for module, spot in pairs.items())
                for pairs in (made.assignments, theirs)
            ]
            task = f"{size} to {size}, seed {seed}"
            yield _row(task, "cost (less the sum of utilities), units", costs[0], costs[1], "SciPy", note)
            yield _row(task, "time, s", ours_s, theirs_s, "SciPy", "ours from the poses on, SciPy's from the matrix")


def subgraph(seeds: Iterable[int], sizes: Iterable[int] = (10, 20, 30)) -> Iterator[Row]:
    """The largest part of a configuration that stays docked in a target of 100 spots, against RDKit's ``FindMCS``."""
    from rdkit import Chem, RDLogger
    from rdkit.Chem import rdFMCS

    RDLogger.DisableLog("rdApp.*")
    for size in sizes:
        for seed in seeds:
            scenario = Scenario.generate(size, 100, seed=seed, configuration_size=size)
            scenario = scenario.with_planner(keep_all_spots=True, spread=0.0)
            made, ours_s = _planned(scenario)
            modules, spots = scenario.module_ids, scenario.spot_ids
            known, ours = as_neutral(made)
            ours = {"allocation": ours["allocation"]}
            graphs = [(len(modules), scenario.links.tolist()), (len(spots), scenario.edges.tolist())]
            pair = [_molecule(Chem, *graph) for graph in graphs]
            found, theirs_s = _timed(lambda pair=pair: rdFMCS.FindMCS(pair, timeout=60), _ROUNDS)
            pattern = Chem.MolFromSmarts(found.smartsString)
            nodes = [list(one.GetSubstructMatch(pattern)) for one in pair]
            spot_of = {modules[module]: spots[spot] for module, spot in zip(*nodes)}
            free = iter([spot for spot in spots if spot not in spot_of.values()])
            theirs = _pairs({module: spot_of.get(module) or next(free) for module in modules})
            verdicts = [neutral_check.judge(known, result) for result in (ours, theirs)]
            blocks = [max(1, verdict["measures"]["largest_block"]) for verdict in verdicts]
            note = f"ours {_judged(verdicts[0])}, RDKit's {_judged(verdicts[1])}"
            task = f"{size} in 100, seed {seed}"
            cut = "; RDKit's search was cut at 60 s" if found.canceled else ""
            yield _row(task, "modules that stay docked (more)", blocks[0], blocks[1], "RDKit", note + cut, more=True)
            yield _row(task, "time, s", ours_s, theirs_s, "RDKit", "ours is the whole allocation, and minds utility" + cut)


def _molecule(chem: Any, nodes: int, edges: Iterable[tuple[int, int]]) -> Any:
    """A graph as a molecule of one element without hydrogens, in which any degree up to four is a valence."""
    editable = chem.RWMol()
    for _ in range(nodes):
        atom = chem.Atom(6)
        atom.SetNoImplicit(True)
        editable.AddAtom(atom)
    for first, second in edges:
        editable.AddBond(first, second, chem.BondType.SINGLE)
    made = editable.GetMol()
    chem.SanitizeMol(made)
    return made


def motion(seeds: Iterable[int], sizes: Iterable[tuple[int, float]] = ((10, 0.2), (10, 0.5), (20, 0.3))) -> Iterator[Row]:
    """Labelled robots on cells, against real-time LaCAM with 100 ms a step.

    LaCAM plans in another model: robots may enter a cell as another leaves it in any direction, which squares of the size of a
    cell may only in the same direction. Its result is judged in the model ``cells``, ours in ``bodies``.
    """
    from rt_lacam import RTLaCAM

    for kind in KINDS:
        for width, share in sizes:
            for seed in seeds:
                drawn = draw(kind, width, share, seed)
                with tempfile.TemporaryDirectory() as folder:
                    path = Path(folder) / "drawn.json"
                    path.write_text(json.dumps(drawn), encoding="utf-8")
                    scenario = Scenario.import_cgshop(path)
                made, ours_s = _timed(lambda scenario=scenario: plan(scenario))
                known, ours = as_neutral(made)
                # Robots of the contest fill their cells.
                known["body_width"] = 1.0
                theirs, theirs_s = _timed(lambda drawn=drawn, width=width: _lacam(RTLaCAM, drawn, width))
                ours_verdict = neutral_check.judge(known, ours)
                task = f"{drawn['name']}, seed {seed}"
                if theirs is None:
                    yield _row(task, "makespan, steps", made.makespan or 0, 0, "LaCAM", "LaCAM found no end in 10,000 steps")
                    continue
                theirs_verdict = neutral_check.judge(known, theirs, "cells")
                contacts = len(neutral_check.judge(known, theirs)["violations"])
                note = (
                    f"ours {_judged(ours_verdict)}, LaCAM's {_judged(theirs_verdict)} in the model of cells; as squares "
                    f"{contacts} pairs of its robots touch"
                )
                for measure, words in (("makespan", "makespan, steps"), ("flowtime", "sum of arrivals, steps")):
                    values = [verdict["measures"][measure] for verdict in (ours_verdict, theirs_verdict)]
                    yield _row(task, words, values[0], values[1], "LaCAM", note)
                yield _row(task, "time, s", ours_s, theirs_s, "LaCAM", "ours is the whole plan, LaCAM has 100 ms a step")


def _lacam(solver_of: Any, drawn: Mapping[str, Any], width: int) -> dict[str, Any] | None:
    """The result of LaCAM in the neutral format; ``None`` without an end."""
    extent = width + 2 * _MARGIN
    grid = [[1] * extent for _ in range(extent)]
    for x, y in drawn["obstacles"]:
        grid[y + _MARGIN][x + _MARGIN] = 0
    starts, goals = ([(y + _MARGIN, x + _MARGIN) for x, y in drawn[field]] for field in ("starts", "targets"))
    solver = solver_of(grid, starts=starts, goals=goals, seed=0)
    at = [tuple(start) for start in starts]
    history = [at]
    try:
        for _ in range(10_000):
            if solver.is_solved(at):
                break
            found = solver.step(deadline_ms=100)
            if found is not None:
                at = [tuple(cell) for cell in found]
                solver.reroot(at)
                history.append(at)
        else:
            return None
    finally:
        solver.close()
    paths = []
    for robot in range(len(starts)):
        cells = [step[robot] for step in history]
        while len(cells) > 1 and cells[-1] == cells[-2]:
            cells.pop()
        points = [[x - _MARGIN, y - _MARGIN, 0.0, float(moment)] for moment, (y, x) in enumerate(cells)]
        paths.append({"module": robot, "waypoints": points})
    return {**_pairs({robot: robot for robot in range(len(starts))}), "motion": paths}


#: For each problem its table, and the packages that it needs: what to import, and what to install.
TABLES: dict[str, tuple[Callable[..., Iterator[Row]], dict[str, str]]] = {
    "assignment": (assignment, {"numpy": "numpy", "scipy": "scipy"}),
    "subgraph": (subgraph, {"numpy": "numpy", "rdkit": "rdkit"}),
    "motion": (motion, {"numpy": "numpy", "rt_lacam": "rt-lacam"}),
}


def _versions(packages: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """The packages that there are, with their versions, and those that are missing."""
    present, absent = [], []
    for name, package in packages.items():
        try:
            importlib.import_module(name)
        except ImportError:
            absent.append(package)
        else:
            present.append(f"{package} {importlib.metadata.version(package)}")
    return present, absent


def _machine() -> str:
    model = ""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.split(": ", 1)[1] for line in lines if line.startswith("model name")), "")
    except OSError:
        pass
    return f"{model or platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}"


def _shown(value: float) -> str:
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:,.0f}"


def _print_table(name: str, rows: list[Row], versions: list[str]) -> None:
    print(f"\n## {name}\n\n{', '.join(versions)}\n")
    print("| task | quantity | ours | peer | peer's | behind | |\n|---|---|---:|---|---:|---:|---|")
    rows.sort(key=lambda row: -(row["behind"] or 0.0))
    for row in rows:
        behind = "" if row["behind"] is None else f"{row['behind']:.3g}"
        numbers = f"{_shown(row['ours'])} | {row['peer']} | {_shown(row['theirs'])} | {behind}"
        print(f"| {row['task']} | {row['quantity']} | {numbers} | {row['note']} |")


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its status."""
    parser = argparse.ArgumentParser(prog="python -m formation.benchmarks", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"of {', '.join(TABLES)}; all by default")
    parser.add_argument("--seeds", type=int, default=3, help="how many instances of each kind and size")
    parser.add_argument("--json", type=Path, help="where to write the rows as well")
    options = parser.parse_args(arguments)
    wrong = [name for name in options.tables if name not in TABLES]
    if wrong:
        parser.error(f"there is no table {wrong[0]}; there are {', '.join(TABLES)}")
    print(f"formation {importlib.metadata.version('formation') if _is_installed() else 'of this folder'}; {_machine()}")
    print("`behind` is how many times worse ours is; below 1 ours is ahead.")
    written: dict[str, list[Row]] = {}
    for name in options.tables or TABLES:
        table, packages = TABLES[name]
        versions, absent = _versions(packages)
        if absent:
            print(f"\n## {name}\n\nnot compared: {', '.join(absent)} is not installed")
            continue
        written[name] = list(table(range(1, options.seeds + 1)))
        _print_table(name, written[name], versions)
    if options.json:
        options.json.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
    return 0


def _is_installed() -> bool:
    try:
        importlib.metadata.version("formation")
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
