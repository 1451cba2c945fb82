"""The package and the command line give the same numbers, bit for bit: JSON texts are compared as they are printed."""

import concurrent.futures
import json
import os
import random
import re

import formation
import pytest

GENERATED = 200
# Runs take longer; tests/soak_comparisons.sh asks for as many.
SIMULATED = int(os.environ.get("FORMATION_SIMULATED", "40"))
# What a clock decides.
TIMES = re.compile(r'"(planning_us|elapsed_ms)":\d+')


def timeless(text):
    return TIMES.sub(r'"\1":0', text.rstrip("\n"))


def compare(launcher, scenario, *, path="-", text=None):
    """Plan, check and explain a scenario both ways."""
    plan = formation.plan(scenario)
    assert timeless(launcher.printed("plan", path, "--json", text=text)) == timeless(plan.to_json())
    module = scenario.module_ids[len(scenario.module_ids) // 2]
    explained = launcher.printed("explain", path, "--module", module, "--json", text=text)
    assert json.loads(explained) == plan.explain(module)
    assert timeless(launcher.printed("explain", path, "--module", module, text=text)) == plan.explain_text(module)
    checked = launcher.run("check", path, "--json", text=text)
    try:
        assert plan.check() == json.loads(checked.stdout)
        assert checked.returncode == (0 if plan.complete else 1)
    except formation.FormationError as error:
        assert checked.returncode == 2 and str(error) in checked.stderr.replace("\n", " ")


def test_shipped_scenarios(launcher, shipped):
    compare(launcher, formation.Scenario.from_file(shipped), path=shipped)


@pytest.mark.parametrize("policy", ["paper", "auction", "hungarian"])
def test_other_policies(launcher, policy):
    scenario = formation.Scenario.generate(20, 18, seed=5, mixed=True).with_planner(policy=policy)
    compare(launcher, scenario, text=scenario.to_yaml())


def drawn(seed):
    """The options of a scenario, and those of the command."""
    chance = random.Random(seed)
    modules = chance.randint(1, 24)
    spots = max(1, modules + chance.randint(-4, 4))
    options, words = {}, []
    kind = chance.randrange(3)
    if kind == 1:
        options["mixed"] = True
        words.append("--mixed")
    elif kind == 2:
        options["configuration_size"] = chance.randint(1, min(6, modules))
        words += ["--configuration-size", options["configuration_size"]]
    if chance.random() < 0.3:
        options["degree"] = 4
        words += ["--degree", 4]
    if chance.random() < 0.3:
        options["touching"] = True
        words.append("--touching")
    elif chance.random() < 0.3:
        options["apart"] = chance.choice([1.5, 2.25, 7.0])
        words += ["--apart", options["apart"]]
    words = ["--modules", modules, "--spots", spots, "--seed", seed, *words]
    return formation.Scenario.generate(modules, spots, seed=seed, **options), words


def compare_drawn(launcher, seed):
    scenario, words = drawn(seed)
    text = launcher.printed("generate", *words)
    assert formation.Scenario.from_yaml(text) == scenario
    assert formation.Scenario.from_yaml(scenario.to_yaml()) == scenario
    assert formation.Scenario.from_dict(scenario.to_dict()) == scenario
    compare(launcher, scenario, text=text)


def test_generated_scenarios(launcher):
    # Each thread mostly waits for the command.
    with concurrent.futures.ThreadPoolExecutor(4) as threads:
        for done in [threads.submit(compare_drawn, launcher, seed) for seed in range(GENERATED)]:
            done.result()


def compare_simulated(launcher, seed):
    """A run of a drawn scenario, with every event."""
    chance = random.Random(seed)
    modules = chance.randint(2, 7)
    scenario = formation.Scenario.generate(modules, modules, seed=seed, mixed=seed % 2 == 0)
    faults = chance.choice(formation.fault_kinds())
    options = ["--json", "--seeds", 1, "--first-seed", seed, "--faults", faults]
    printed = launcher.printed("simulate", "-", *options, text=scenario.to_yaml())
    ours = formation.simulate(scenario, seed=seed, faults=faults)
    assert json.loads(timeless(printed)) == {**ours.to_dict(), "elapsed_ms": 0}, (seed, faults)


def test_simulated_runs_of_generated_scenarios(launcher):
    with concurrent.futures.ThreadPoolExecutor(4) as threads:
        for done in [threads.submit(compare_simulated, launcher, seed) for seed in range(SIMULATED)]:
            done.result()


@pytest.mark.parametrize("faults", formation.fault_kinds())
def test_simulated_runs(launcher, faults):
    scenario = formation.Scenario.generate(9, 8, seed=2, mixed=True)
    options = ["--json", "--seeds", 1, "--first-seed", 3, "--faults", faults]
    printed = launcher.printed("simulate", "-", *options, text=scenario.to_yaml())
    ours = formation.simulate(scenario, seed=3, faults=faults)
    assert json.loads(timeless(printed)) == {**ours.to_dict(), "elapsed_ms": 0}
    assert len(list(ours.events)) == len(ours.to_dict()["transcript"])


def test_several_seeds_of_drawn_scenarios(launcher):
    options = ["--json", "--seeds", 6, "--modules", "5-9"]
    ours = formation.simulate(seeds=6, modules=(5, 9))
    printed = launcher.printed("simulate", *options)
    assert json.loads(timeless(printed)) == {**ours.to_dict(), "elapsed_ms": 0}
    assert [run["seed"] for run in ours.runs] == list(range(6))


def test_imported_maps(launcher, tmp_path):
    path = tmp_path / "room.map"
    rows = ["@@@@@@@@@@@@", *["@..........@"] * 3, "@@@@@..@@@@@", *["@..........@"] * 3, "@@@@@@@@@@@@"]
    path.write_text(f"type octile\nheight {len(rows)}\nwidth 12\nmap\n" + "\n".join(rows) + "\n")
    text = launcher.printed("import", path, "--modules", 5, "--seed", 4)
    scenario = formation.Scenario.import_map(path, modules=5, seed=4)
    assert formation.Scenario.from_yaml(text) == scenario
    compare(launcher, scenario, text=text)


def test_reports(launcher, tmp_path, shipped):
    """Pictures and page are those of `formation plan --report`."""
    plan = formation.plan(formation.Scenario.from_file(shipped))
    launcher.printed("plan", shipped, "--report", tmp_path)
    assert (tmp_path / "before.svg").read_text() == plan.before().svg
    assert (tmp_path / "after.svg").read_text() == plan.after().svg
