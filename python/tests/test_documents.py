"""The tutorial as readers type it: every `python` block of a page, in order."""

import pathlib
import re
import runpy
import types

import formation
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_the_tutorial_runs(tmp_path, monkeypatch):
    blocks = BLOCK.findall((ROOT / "docs/python.md").read_text())
    assert len(blocks) == 5
    monkeypatch.chdir(tmp_path)
    script = tmp_path / "tutorial.py"
    script.write_text("\n".join(blocks))
    names = runpy.run_path(str(script))
    assert (tmp_path / "corner.svg").is_file() and names["own"].complete


def test_the_example_of_the_package_is_true():
    plan = formation.plan(formation.Scenario.from_map(target="o-o-o", modules="A-A   s"))
    assert f"# {plan.assignments}, module: spot" in formation.__doc__


@pytest.mark.parametrize("name", formation.__all__)
def test_everything_public_is_documented(name):
    value = getattr(formation, name)
    if name == "Policy":
        return
    assert value.__doc__
    if isinstance(value, type):
        for attribute, member in vars(value).items():
            if not attribute.startswith("_") and isinstance(member, (types.FunctionType, property, classmethod)):
                assert member.__doc__, f"{name}.{attribute}"
