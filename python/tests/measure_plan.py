"""How long a plan takes from Python and from the command line, both from the text of a scenario to the JSON of its plan.

Runs the two in turns, and prints the shortest time of each and their ratio, by the clock and in processor time, which other work
on the machine disturbs less. The program, which FORMATION_PROGRAM names, is of the same profile as the package.

Usage: measure_plan.py [MODULES [ROUNDS]]
"""

import os
import resource
import subprocess
import sys
import time

import formation


def main():
    modules, rounds = (int(word) for word in (sys.argv[1:] + ["1000", "5"][len(sys.argv) - 1 :]))
    text = formation.Scenario.generate(modules, modules, seed=1, mixed=True).to_yaml()
    command = [os.environ["FORMATION_PROGRAM"], "plan", "-", "--json"]

    def from_python():
        formation.plan(formation.Scenario.from_yaml(text)).to_json()

    def from_the_command_line():
        subprocess.run(command, input=text, text=True, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    ways = {"python": from_python, "command line": from_the_command_line}
    times = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            begun = (time.perf_counter(), used())
            way()
            times[name].append((time.perf_counter() - begun[0], used() - begun[1]))
    best = {name: [min(column) for column in zip(*taken)] for name, taken in times.items()}
    for name, (clock, processor) in best.items():
        print(f"{name}: {clock:.3f} s, {processor:.3f} s of the processors, the shortest of {rounds}")
    clock, processor = (ours / theirs for ours, theirs in zip(best["python"], best["command line"]))
    print(f"ratio: {clock:.3f}, {processor:.3f} of the processors")


def used():
    """The processor time of this process and of those that it has waited for."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


main()
