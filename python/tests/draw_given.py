"""Scenarios with an allocation that the target gives, and whether a run formed it.

Usage: draw_given.py FOLDER COUNT    writes given_N.yaml
       draw_given.py RUN SCENARIO    compares the JSON of a run with its scenario
"""

import json
import pathlib
import random
import sys

import formation


def drawn(seed):
    scenario = formation.Scenario.generate(8, 8, seed=seed, mixed=True)
    spots = scenario.spot_ids
    random.Random(seed).shuffle(spots)
    fields = scenario.to_dict()
    fields["planner"] = {"policy": "given"}
    pairs = zip(scenario.module_ids, spots)
    fields["target"]["allocation"] = [{"module": module, "spot": spot} for module, spot in pairs]
    docked = [module["id"] for configuration in fields["configurations"] for module in configuration["modules"]]
    fields["target"]["detached"] = docked
    return formation.Scenario.from_dict(fields)


def main():
    path, other = pathlib.Path(sys.argv[1]), sys.argv[2]
    if path.is_dir():
        for seed in range(int(other)):
            (path / f"given_{seed}.yaml").write_text(drawn(seed).to_yaml())
        return
    run = json.loads(path.read_text())
    given = formation.Scenario.from_file(other).to_dict()["target"]["allocation"]
    formed = {pair["module"]: pair["spot"] for pair in run["assignments"]}
    if run["verdict"] != "COMPLETE" or formed != {pair["module"]: pair["spot"] for pair in given}:
        sys.exit(f"{other}: {run['verdict']}, formed {formed}")
    print(f"{pathlib.Path(other).name}: formed as given, {run['verdict']}")


main()
