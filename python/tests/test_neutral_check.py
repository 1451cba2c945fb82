"""The neutral checker accepts plans of ours, and finds each deliberate fault. It shares nothing with the package."""

import ast
import copy
import json
import pathlib
import subprocess
import sys

import formation
import pytest
from formation import benchmarks, neutral_check

FILE = pathlib.Path(neutral_check.__file__)


def test_it_imports_the_standard_library_alone():
    names = set()
    for node in ast.walk(ast.parse(FILE.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0
            names.add(node.module)
        elif isinstance(node, ast.Import):
            names |= {name.name for name in node.names}
    assert names <= {"__future__", "argparse", "collections", "json", "math", "sys"}


def instance(**fields):
    """Two modules that exchange rows, with an obstacle between their ways."""
    return {
        "modules": [{"id": 1, "x": 0, "y": 0}, {"id": 2, "x": 0, "y": 2}],
        "spots": [{"id": 1, "x": 2, "y": 0}, {"id": 2, "x": 2, "y": 2}],
        "edges": [],
        "body_width": 1.0,
        "obstacles": [{"x": 1, "y": 1, "width": 1, "height": 1}],
        "arena": {"x": 1, "y": 1, "width": 9, "height": 9},
        **fields,
    }


def path(module, *points):
    return {"module": module, "waypoints": [[x, y, 0.0, t] for x, y, t in points]}


def result(*motion, allocation=((1, 1), (2, 2))):
    pairs = [{"module": module, "spot": spot} for module, spot in allocation]
    return {"allocation": pairs, "motion": list(motion)}


GOOD = result(path(1, (0, 0, 0), (1, 0, 1), (2, 0, 2)), path(2, (0, 2, 0), (0, 2, 3), (2, 2, 5)))


def found(instance, result, model="bodies"):
    return "\n".join(neutral_check.judge(instance, result, model)["violations"])


def test_a_good_result_is_valid_and_measured():
    for model in neutral_check.MODELS:
        steps = copy.deepcopy(GOOD)
        steps["motion"][1] = path(2, (0, 2, 0), (0, 2, 3), (1, 2, 4), (2, 2, 5))
        verdict = neutral_check.judge(instance(), steps, model)
        assert verdict["valid"], verdict
        measures = verdict["measures"]
        assert measures["makespan"] == 5 and measures["flowtime"] == 7 and measures["path_length"] == 4
        assert measures["distance"] == 4 and measures["placed"] == 2


@pytest.mark.parametrize(
    ("motion", "allocation", "words"),
    [
        # Overlapping motion: into a module at rest, and across its way.
        ([path(1, (0, 0, 0), (0, 1, 1), (0, 2, 2), (2, 0, 9))], None, "modules 1 and 2 overlap at time 1.000"),
        # Corners that are cut: that of another module, and of an obstacle, which the middle of the module avoids.
        (
            [path(1, (0, 0, 0), (0, 2, 2), (2, 0, 9)), path(2, (0, 2, 0), (0, 2, 0.5), (2, 2, 2.5))],
            None,
            "modules 1 and 2 overlap at time 1.",
        ),
        ([path(1, (0, 0, 0), (1, -0.2, 2), (2, 0.5, 4), (2, 0, 5)), GOOD["motion"][1]], None, "module 1 is in an obstacle"),
        ([path(1, (0, 0, 0), (0, 1, 1), (2, 1, 3), (2, 0, 4)), GOOD["motion"][1]], None, "module 1 is in an obstacle"),
        # Swapped: each at the other's spot.
        ([path(1, (0, 0, 0), (2, 0, 2)), path(2, (0, 2, 0), (2, 2, 2))], ((1, 2), (2, 1)), "module 1 does not end on spot 2"),
        # Teleport.
        ([path(1, (0, 0, 0), (2, 0, 1)), GOOD["motion"][1]], None, "module 1 goes 2.000 units in 1"),
        # The wrong spot, the wrong heading, another start, no motion at all.
        ([path(1, (0, 0, 0), (1, 0, 1)), GOOD["motion"][1]], None, "module 1 does not end on spot 1"),
        ([{"module": 1, "waypoints": [[0, 0, 0, 0], [2, 0, 1.5, 2]]}, GOOD["motion"][1]], None, "does not end on spot 1"),
        ([path(1, (0, 0.1, 0), (2, 0, 3)), GOOD["motion"][1]], None, "module 1 does not begin where it stands"),
        ([GOOD["motion"][1]], None, "module 1 does not end on spot 1"),
        # Beyond the arena.
        ([path(1, (0, 0, 0), (0, -3.5, 4), (2, 0, 9)), GOOD["motion"][1]], None, "module 1 leaves the arena"),
        # The allocation itself.
        (GOOD["motion"], ((1, 1),), "1 modules have a spot; 2 can have one"),
        (GOOD["motion"], ((1, 1), (2, 1)), "modules 1 and 2 both have spot 1"),
        (GOOD["motion"], ((1, 1), (1, 2)), "module 1 has two spots"),
        (GOOD["motion"], ((1, 1), (7, 2)), "there is no module 7"),
        (GOOD["motion"], ((1, 1), (2, 7)), "there is no spot 7"),
    ],
)
def test_each_fault_is_found(motion, allocation, words):
    pairs = allocation or ((1, 1), (2, 2))
    assert words in found(instance(), result(*motion, allocation=pairs))


def test_pins_and_given_spots_are_kept():
    fields = instance(given=[{"module": 1, "spot": 2}])
    assert "module 1 is to have spot 2, and has 1" in found(fields, GOOD)
    fields = instance()
    fields["modules"][0]["pin"] = 2
    assert "module 1 keeps spot 2, and has 1" in found(fields, GOOD)


def test_following_round_a_corner_is_contact_of_bodies_and_none_of_cells():
    fields = {
        "modules": [{"id": 1, "x": 0, "y": 0}, {"id": 2, "x": 1, "y": 0}],
        "spots": [{"id": 1, "x": 1, "y": 0}, {"id": 2, "x": 1, "y": 1}],
        "edges": [],
        "body_width": 1.0,
    }
    corner = result(path(1, (0, 0, 0), (1, 0, 1)), path(2, (1, 0, 0), (1, 1, 1)))
    assert "modules 1 and 2 overlap" in found(fields, corner) and not found(fields, corner, "cells")
    row = {**fields, "spots": [{"id": 1, "x": 1, "y": 0}, {"id": 2, "x": 2, "y": 0}]}
    following = result(path(1, (0, 0, 0), (1, 0, 1)), path(2, (1, 0, 0), (2, 0, 1)))
    assert not found(row, following), "in one direction they never overlap"
    places = {**fields, "spots": [{"id": 1, "x": 1, "y": 0}, {"id": 2, "x": 0, "y": 0}]}
    changed = result(path(1, (0, 0, 0), (1, 0, 1)), path(2, (1, 0, 0), (0, 0, 1)))
    assert "modules 1 and 2 change places at time 1" in found(places, changed, "cells")
    assert "modules 1 and 2 overlap" in found(places, changed)
    both = result(path(1, (0, 0, 0), (1, 0, 1)), path(2, (1, 0, 0), (1, 0, 1), (1, 1, 2)))
    assert "modules 1 and 2 are both at (1, 0) at time 1" in found(fields, both, "cells")
    leap = result(path(1, (0, 0, 0), (1, 1, 1), (1, 0, 2)), path(2, (1, 0, 0), (1, 1, 1)))
    assert "moves by more than one cell" in found({**fields, "max_speed": 3}, leap, "cells")


def test_round_and_turning_bodies():
    fields = {
        "modules": [{"id": 1, "x": 0, "y": 0}, {"id": 2, "x": 0.95, "y": 0.95}],
        "spots": [{"id": 1, "x": 0, "y": 0, "theta": 0.7853981}, {"id": 2, "x": 0.95, "y": 0.95}],
        "edges": [],
        "body_width": 0.9,
    }
    turned = result({"module": 1, "waypoints": [[0, 0, 0, 0], [0, 0, 0.7853981, 1]]})
    assert not found(fields, turned)
    fields["modules"][1].update(x=0.98, y=0.0)
    fields["spots"][1].update(x=0.98, y=0.0)
    assert "modules 1 and 2 overlap" in found(fields, turned)
    assert not found({**fields, "body": "circle"}, turned)
    # From just below half a turn to just above: by a hundredth, not round.
    fields["modules"][0]["theta"], fields["spots"][0]["theta"] = 3.14, -3.14
    assert not found(fields, result({"module": 1, "waypoints": [[0, 0, 3.14, 0], [0, 0, -3.14, 1]]}))


def test_what_is_not_of_the_format_is_refused():
    for change, words in [
        (lambda fields: fields.pop("spots"), "instance: the field 'spots' is missing"),
        (lambda fields: fields["modules"].append(fields["modules"][0]), "an identifier is used twice"),
    ]:
        fields = instance()
        change(fields)
        with pytest.raises(neutral_check.FormatError, match=words):
            neutral_check.judge(fields, GOOD)
    for motion, words in [
        ([path(1, (0, 0, 0), (1, 0, 0))], "times of waypoints must ascend"),
        ([path(9, (0, 0, 0))], "motion of module 9, which there is not"),
        ([path(1, (0, 0, float("nan")))], "waypoints are"),
    ]:
        with pytest.raises(neutral_check.FormatError, match=words):
            neutral_check.judge(instance(), result(*motion))
    with pytest.raises(neutral_check.FormatError, match="modules 1 and 2 are not docked at the start"):
        neutral_check.judge(instance(), {**GOOD, "docked": [[1, 2, None]]})


def test_docked_modules_are_one_body_until_they_undock():
    fields = {
        "modules": [{"id": 1, "x": 0, "y": 0, "links": [2]}, {"id": 2, "x": 1, "y": 0, "links": [1]}],
        "spots": [{"id": 1, "x": 0, "y": 0}, {"id": 2, "x": 0, "y": 1}],
        "edges": [[1, 2]],
    }
    folded = result(path(2, (1, 0, 0), (1, 0, 3), (0.5, 0, 4), (0, 1, 6)))
    assert "modules 1 and 2 overlap at time 3.200" in found(fields, folded)
    assert not found(fields, {**folded, "docked": [[1, 2, None]]})
    assert not found(fields, {**folded, "docked": [[2, 1, 6]]})
    assert "modules 1 and 2 overlap at time 4" in found(fields, {**folded, "docked": [[1, 2, 3.5]]})
    verdict = neutral_check.judge(fields, folded)
    assert verdict["measures"]["kept_links"] == 1 and verdict["measures"]["largest_block"] == 2


@pytest.mark.parametrize("seed", range(6))
def test_plans_of_ours_are_valid(seed):
    kind = {"mixed": True} if seed % 2 else {}
    scenario = formation.Scenario.generate(16, 16, seed=seed, **kind)
    verdict = neutral_check.judge(*benchmarks.as_neutral(formation.plan(scenario)))
    assert verdict["valid"], verdict["violations"]


def test_a_plan_of_ours_with_a_fault_is_not_valid():
    scenario = formation.Scenario.generate(12, 12, seed=3)
    plan = formation.plan(scenario)
    instance, result = benchmarks.as_neutral(plan)
    one, other = result["allocation"][:2]
    one["spot"], other["spot"] = other["spot"], one["spot"]
    assert not neutral_check.judge(instance, result)["valid"]
    instance, result = benchmarks.as_neutral(plan)
    for entry in result["motion"]:
        # All set off at once, without waiting for each other.
        entry["waypoints"] = [[*point[:3], time] for time, point in enumerate(entry["waypoints"])]
    assert neutral_check.judge({**instance, "max_speed": 99}, result)["valid"] is False


def test_the_command(tmp_path):
    files = [tmp_path / "instance.json", tmp_path / "result.json"]
    files[0].write_text(json.dumps(instance()))
    for judged, status in ((GOOD, 0), (result(GOOD["motion"][1]), 1), ({}, 2)):
        files[1].write_text(json.dumps(judged))
        command = [sys.executable, "-I", str(FILE), *map(str, files)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == status, done.stderr
        assert status == 2 or json.loads(done.stdout)["valid"] is (status == 0)
