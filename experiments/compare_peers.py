#!/usr/bin/env python3
"""Runs public solvers and ours on the same instances, and prints how many times slower the public solvers are.

    python3 -m venv .venv && .venv/bin/pip install -r experiments/requirements.txt
    .venv/bin/python experiments/compare_peers.py [--seed 1] [--timeout 60] [--json FILE]

Our part is the release build of `core/planner/examples/peer_instances.rs`. The conversion of an instance into a peer's own
form is not timed: only the solving is, on one thread, and the median of several runs counts. All times are processor
times, which other work on the machine does not lengthen. Answers are compared where possible, and a difference ends the
run with an error.
"""

import argparse
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

# One thread each, like ours; the libraries read these variables when they are loaded.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import igraph
import networkx
import numpy
import rdkit
import scipy
from rdkit import Chem, RDLogger
from rdkit.Chem import rdFMCS
from scipy.optimize import linear_sum_assignment

ROOT = Path(__file__).resolve().parent.parent
RUNS_MAX = 25
RUN_TIME_MAX_S = 3.0


class Comparison:
    """The rows of the table, and the answers that differ."""

    def __init__(self):
        self.rows = []
        self.differences = []

    def add(self, task, peer, ours_s, peer_s, note=""):
        self.rows.append({"task": task, "peer": peer, "ours_s": ours_s, "peer_s": peer_s, "note": note})

    def check(self, holds, task, what):
        if not holds:
            self.differences.append(f"{task}: {what}")

    def print_table(self):
        print("| task | peer | ours | peer's | peer's / ours | |\n|---|---|---:|---:|---:|---|")
        for row in self.rows:
            ratio = row["peer_s"] / row["ours_s"]
            ratio = f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.2f}"
            times = f"{readable(row['ours_s'])} | {readable(row['peer_s'])}"
            print(f"| {row['task']} | {row['peer']} | {times} | {ratio} | {row['note']} |")


def readable(seconds):
    for unit, factor in (("s", 1), ("ms", 1e3), ("us", 1e6)):
        if seconds * factor >= 1:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def timed(run):
    """The answer of `run` and the median of its processor times in seconds."""
    begin = time.perf_counter()
    times = []
    while True:
        start = time.thread_time()
        answer = run()
        times.append(time.thread_time() - start)
        if len(times) == RUNS_MAX or time.perf_counter() - begin > RUN_TIME_MAX_S:
            return answer, statistics.median(times)


def within(timeout_s, run):
    """The answer of `run`, None if it exceeds the timeout, and its time. Runs in a process that can be ended."""

    def child(sending):
        start = time.thread_time()
        answer = run()
        sending.send((answer, time.thread_time() - start))

    forking = multiprocessing.get_context("fork")
    receiving, sending = forking.Pipe(duplex=False)
    process = forking.Process(target=child, args=(sending,))
    process.start()
    outcome = receiving.recv() if receiving.poll(timeout_s) else (None, timeout_s)
    process.terminate()
    process.join()
    return outcome


def molecule(graph):
    """A tree as a molecule of one element without hydrogens, so that any degree up to four is a valence."""
    editable = Chem.RWMol()
    for _ in range(graph["nodes"]):
        atom = Chem.Atom(6)
        atom.SetNoImplicit(True)
        editable.AddAtom(atom)
    for first, second in graph["edges"]:
        editable.AddBond(first, second, Chem.BondType.SINGLE)
    made = editable.GetMol()
    Chem.SanitizeMol(made)
    return made


def compare_common_subtrees(instances, timeout_s, comparison):
    for instance in instances:
        size = instance["configuration"]["nodes"]
        task = f"common subtree, {size} in {instance['target']['nodes']}, seed {instance['seed']}"
        pair = [molecule(instance["configuration"]), molecule(instance["target"])]
        start = time.thread_time()
        # Trees have no rings, and any connected part is allowed: the maximum common connected subgraph by bonds.
        found = rdFMCS.FindMCS(pair, timeout=timeout_s)
        elapsed = time.thread_time() - start
        if found.canceled:
            note = f"cut at {timeout_s} s with {found.numAtoms} matched, ours {instance['matched']}"
            comparison.check(found.numAtoms <= instance["matched"], task, note)
        else:
            note = f"both match {instance['matched']}; RDKit's ignores utility"
            comparison.check(found.numAtoms == instance["matched"], task, f"RDKit matches {found.numAtoms}")
        comparison.add(task, "RDKit FMCS", instance["seconds"], elapsed, note)


def compare_whole_fits(instances, timeout_s, comparison):
    """LAD decides whether the whole configuration fits: less than ours answers, on the same pairs of trees."""
    for instance in instances:
        size = instance["configuration"]["nodes"]
        task = f"does all of it fit, {size} in {instance['target']['nodes']}, seed {instance['seed']}"
        pattern, host = (
            igraph.Graph(n=graph["nodes"], edges=graph["edges"])
            for graph in (instance["configuration"], instance["target"])
        )
        fits, elapsed = within(timeout_s, lambda: host.subisomorphic_lad(pattern))
        if fits is None:
            note = f"cut at {timeout_s} s"
        else:
            comparison.check(fits == (instance["matched"] == size), task, f"LAD says {fits}")
            note = f"both say {'yes' if fits else 'no'}; ours also finds the best part"
        comparison.add(task, "igraph LAD", instance["seconds"], elapsed, note)


def compare_assignments(instances, comparison):
    for instance in instances:
        utilities = numpy.array(instance["utilities"], dtype=numpy.int64)
        task = f"singletons, {len(utilities)} to {utilities.shape[1]} spots"
        # SciPy computes in doubles, in which micro-units are exact.
        matrix = utilities.astype(numpy.float64)
        (rows, columns), elapsed = timed(lambda: linear_sum_assignment(matrix, maximize=True))
        optimum = int(utilities[rows, columns].sum())
        comparison.check(optimum == instance["total"], task, f"SciPy reaches {optimum}, ours {instance['total']}")
        comparison.add(
            task, "SciPy linear_sum_assignment", instance["seconds"], elapsed,
            "equal optimum; ours is all turns, from the poses on, SciPy's from the finished matrix",
        )


def compare_centralities(instances, comparison):
    for instance in instances:
        nodes, edges = instance["target"]["nodes"], instance["target"]["edges"]
        task = f"betweenness, {nodes} spots"
        graph = networkx.Graph()
        graph.add_nodes_from(range(nodes))
        graph.add_edges_from(edges)
        by_networkx, elapsed = timed(lambda: networkx.betweenness_centrality(graph))
        comparison.add(task, "networkx", instance["seconds"], elapsed)
        other = igraph.Graph(n=nodes, edges=edges)
        pairs = (nodes - 1) * (nodes - 2) / 2
        by_igraph, elapsed = timed(other.betweenness)
        comparison.add(task, "igraph", instance["seconds"], elapsed)
        for node, value in enumerate(instance["betweenness"]):
            for name, theirs in (("networkx", by_networkx[node]), ("igraph", by_igraph[node] / pairs)):
                comparison.check(abs(value / 1e6 - theirs) <= 1e-6, task, f"{name} has {theirs} for {node}, ours {value}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1, help="of the instances")
    parser.add_argument("--timeout", type=int, default=60, help="seconds after which a search of a peer is cut")
    parser.add_argument("--json", type=Path, help="where to write the figures as well")
    arguments = parser.parse_args()
    RDLogger.DisableLog("rdApp.*")
    example = ["-p", "formation_planner", "--example", "peer_instances"]
    command = ["cargo", "run", "--release", "--quiet", *example, "--", str(arguments.seed)]
    ours = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE)
    instances = json.loads(ours.stdout)
    comparison = Comparison()
    compare_common_subtrees(instances["common_subtrees"], arguments.timeout, comparison)
    compare_whole_fits(instances["common_subtrees"], arguments.timeout, comparison)
    compare_assignments(instances["assignments"], comparison)
    compare_centralities(instances["centralities"], comparison)
    print(
        f"RDKit {rdkit.__version__}, SciPy {scipy.__version__}, networkx {networkx.__version__}, "
        f"igraph {igraph.__version__}, seed {arguments.seed}\n"
    )
    comparison.print_table()
    if arguments.json:
        arguments.json.write_text(json.dumps(comparison.rows, indent=1) + "\n")
    if comparison.differences:
        sys.exit("error: answers differ\n" + "\n".join(comparison.differences))


if __name__ == "__main__":
    main()
