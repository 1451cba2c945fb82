"""Instances of the CG:SHOP Challenge 2021 are planned, and the contest's own checker accepts the solutions."""

import json

import formation
import pytest
from formation.benchmarks import KINDS, draw


@pytest.fixture
def checker():
    """Raises what the contest's checker says against a solution."""
    contest = pytest.importorskip("cgshop2021_pyutils", reason="the contest's checker is not installed")
    from cgshop2021_pyutils.instance import InstanceReader
    from cgshop2021_pyutils.solution.solution_reader import SolutionReader

    def check(instance, solution):
        known = InstanceReader().from_json_obj(instance)
        contest.validate(SolutionReader({known.name: known}).from_json_obj(solution))

    return check


def written(tmp_path, instance):
    path = tmp_path / f"{instance['name']}.instance.json"
    path.write_text(json.dumps(instance))
    return path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("width", "share"), [(6, 0.9), (12, 0.5), (18, 0.2)])
def test_the_checker_of_the_contest_accepts_plans(checker, tmp_path, kind, width, share):
    instance = draw(kind, width, share, 1)
    scenario = formation.Scenario.import_cgshop(written(tmp_path, instance))
    plan = formation.plan(scenario)
    assert plan.complete and plan.assignments == {robot: robot for robot in range(len(instance["starts"]))}
    solution = plan.cgshop_solution()
    checker(instance, solution)
    assert len(solution["steps"]) == plan.makespan >= plan.makespan_bound


def test_the_checker_finds_what_is_wrong(checker):
    instance = {"name": "pair", "starts": [[0, 0], [1, 0]], "targets": [[1, 0], [2, 0]], "obstacles": [[1, 1]]}
    checker(instance, {"instance": "pair", "steps": [{"1": "E"}, {"0": "E"}]})
    for steps in ([{"0": "E"}, {"1": "E"}], [{"1": "E"}], [{"1": "N"}]):
        with pytest.raises(RuntimeError):
            checker(instance, {"instance": "pair", "steps": steps})


def test_the_command_line_prints_the_same(launcher, tmp_path):
    instance = draw("clusters_walled", 10, 0.4, 3)
    path = written(tmp_path, instance)
    text = launcher.printed("import", path)
    scenario = formation.Scenario.import_cgshop(path)
    assert formation.Scenario.from_yaml(text) == scenario
    assert formation.Scenario.from_yaml(scenario.to_yaml()) == scenario
    assert formation.Scenario.from_dict(scenario.to_dict()) == scenario
    printed = launcher.printed("plan", "-", "--cgshop", text=text)
    assert json.loads(printed) == formation.plan(scenario).cgshop_solution()


def test_a_target_in_parts_is_planned_and_not_formed(launcher, tmp_path):
    instance = {"name": "apart", "starts": [[0, 0], [1, 0]], "targets": [[0, 3], [5, 3]], "obstacles": []}
    path = written(tmp_path, instance)
    scenario = formation.Scenario.import_cgshop(path)
    assert formation.plan(scenario).complete and formation.check(scenario)["complete"]
    in_parts = "target.in_parts: the target is in 2 parts, and modules dock into one formation"
    with pytest.raises(formation.ScenarioError, match="is in 2 parts") as caught:
        formation.simulate(scenario)
    assert caught.value.field == "target.in_parts"
    file = tmp_path / "apart.yaml"
    file.write_text(scenario.to_yaml())
    for command in ("run", "simulate"):
        done = launcher.run(command, file)
        assert done.returncode == 2 and in_parts in done.stderr.replace("\n", " "), done.stderr
    with pytest.raises(formation.ScenarioError, match="belongs to `policy: given`; the policy is exact"):
        formation.plan(scenario, policy="exact")
    done = launcher.run("plan", file, "--policy", "exact")
    assert done.returncode == 2 and "belongs to `policy: given`; the policy is exact" in done.stderr.replace("\n", " ")


def test_what_is_wrong_is_named(tmp_path):
    with pytest.raises(formation.OptionError, match=r"targets\[1\]: \[0, 3\] is targets\[0\] already"):
        formation.Scenario.import_cgshop(
            written(tmp_path, {"name": "same", "starts": [[0, 0], [1, 0]], "targets": [[0, 3], [0, 3]], "obstacles": []})
        )
    with pytest.raises(formation.OptionError, match="ends in .json"):
        formation.Scenario.import_cgshop(tmp_path / "instance.txt")
    turned = formation.Scenario.from_dict(
        {"target": {"spots": [{"id": 1, "x": 3, "y": 0}]}, "singletons": [{"id": 1, "x": 0, "y": 0, "theta": 0.5}]}
    )
    with pytest.raises(formation.PlanError, match="step 1 of module 1 leads from no cell to the next"):
        formation.plan(turned).cgshop_solution()
