"""Scenarios: how they are made, and what is refused where."""

import json

import formation
import numpy as np
import pytest
from formation import Scenario, ScenarioError

LISTED = """\
name: listed
target:
  spots:
    - {id: 1, x: 0, y: 0}
    - {id: 2, x: 1, y: 0}
  edges: [[1, 2]]
singletons:
  - {id: 7, x: 5, y: 0.25, theta: 1.5}
  - {id: 3, x: -5, y: 0}
"""


@pytest.mark.parametrize(
    ("old", "new", "field", "line"),
    [
        ("theta: 1.5", "theta: 90", "singletons[0].theta", 8),
        ("id: 3, x: -5", "id: 7, x: -5", "singletons[1].id", 9),
        ("[[1, 2]]", "[[1, 9]]", "target.edges[0]", 6),
        ("x: 1, y: 0}", "x: 1}", "target.spots[1]", 5),
        ("name: listed", "nmae: listed", None, 1),
        ("x: -5, y: 0}", "x: -5, y: 0", None, None),
        ("[[1, 2]]", "[[1, 2]]\nplanner: {policy: magic}", "planner.policy", 7),
    ],
)
def test_a_refused_field_is_named_with_its_line(old, new, field, line):
    assert old in LISTED
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_yaml(LISTED.replace(old, new))
    error = caught.value
    assert error.field == field, error
    if line is None:
        assert error.line is not None and field is None
    else:
        assert error.line == line, error
    assert str(error).startswith(f"line {error.line} column {error.column}: ") and isinstance(error, ValueError)


def test_a_mapping_has_fields_but_no_lines():
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict({"target": {"map": "o"}, "singletons": [{"id": 1, "x": 0, "y": 0, "theta": 90}]})
    assert (caught.value.field, caught.value.line) == ("singletons[0].theta", None)
    for value in [float("nan"), object(), {1: {2}}]:
        with pytest.raises(ScenarioError, match="is no scenario"):
            Scenario.from_dict({"name": value})


@pytest.mark.parametrize("text", ["", "[]", "null", "- a", "\0", "a: *b", "[" * 1000, "é" * 10])
def test_anything_else_is_refused(text):
    with pytest.raises(ScenarioError):
        Scenario.from_yaml(text)


def test_arrays_are_in_the_order_of_identifiers():
    scenario = Scenario.from_yaml(LISTED)
    assert scenario.module_ids == [3, 7] and scenario.spot_ids == [1, 2]
    assert scenario.starts.tolist() == [[-5, 0, 0], [5, 0.25, 1.5]]
    assert scenario.spots.shape == (2, 3) and scenario.edges.tolist() == [[0, 1]]
    assert scenario.links.shape == (0, 2)
    utilities = scenario.utilities
    assert utilities.shape == (2, 2) and utilities.dtype == np.float64
    # A spot is worth more to the module that stands nearer.
    assert utilities[0, 0] - utilities[0, 1] > utilities[1, 0] - utilities[1, 1]


def test_utilities_are_those_that_explanations_print():
    scenario = Scenario.generate(12, 12, seed=4)
    plan = formation.plan(scenario)
    for row, module in enumerate(scenario.module_ids):
        for other in plan.explain(module)["alternatives"]:
            assert scenario.utilities[row, scenario.spot_ids.index(other["spot"])] == other["utility"]


def test_a_scenario_may_hold_numpy_values():
    data = json.loads(json.dumps(Scenario.from_yaml(LISTED).to_dict()))
    data["target"]["spots"][1]["x"] = np.float64(1)
    data["target"]["edges"] = np.array([[1, 2]])
    assert Scenario.from_dict(data) == Scenario.from_yaml(LISTED)


def test_drawings(tmp_path):
    scenario = Scenario.from_map("o-o-o", "A-A   s", name="drawn")
    assert Scenario.from_yaml(f"name: drawn\n{scenario.to_map()}").to_dict() == scenario.to_dict()
    assert "<svg" in scenario._repr_svg_()
    path = tmp_path / "drawn.yaml"
    path.write_text("\ufeff" + scenario.to_yaml())
    assert Scenario.from_file(path) == scenario
    path.write_bytes(b"name: \xff")
    with pytest.raises(ScenarioError, match="UTF-8"):
        Scenario.from_file(path)
    with pytest.raises(FileNotFoundError):
        Scenario.from_file(tmp_path / "missing.yaml")
    indented = Scenario.from_map(
        """
        o-o-o
        """,
        """
        A-A   s
        """,
        name="drawn",
    )
    assert indented == scenario
    walled = Scenario.from_map("o", "s", obstacles=[{"x": 0, "y": 5, "width": 1, "height": 1}])
    assert Scenario.from_yaml(walled.to_yaml()) == walled


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"modules": 0}, "modules"),
        ({"degree": 9}, "degree"),
        ({"apart": 1.0}, "apart"),
        ({"apart": float("nan")}, "apart"),
        ({"mixed": True, "configuration_size": 2}, "exclude"),
        ({"configuration_size": 0}, "configuration"),
    ],
)
def test_options_out_of_range_are_named(options, words):
    with pytest.raises(formation.OptionError, match=words):
        Scenario.generate(**{"modules": 5, "spots": 5, "seed": 1, **options})
