"""Scenarios: a target, and the modules that are to form it."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any
from collections.abc import Mapping

from . import _native
from ._arrays import array
from .errors import OptionError, ScenarioError
from .figures import Picture

if TYPE_CHECKING:
    import numpy as np

    from .plans import Plan

__all__ = ["Scenario"]

_FILE_BYTES_MAX = 16 * 1024 * 1024


class Scenario:
    """A validated scenario.

    Make one with :meth:`from_yaml`, :meth:`from_file`, :meth:`from_dict`, :meth:`from_map`, :meth:`generate`,
    :meth:`import_map` or :meth:`import_cgshop`. It never changes. Lengths are in units (the size of a module), headings in
    radians. ``docs/scenario_file.md`` describes every field.
    """

    def __init__(self, native: _native.NativeScenario) -> None:
        self._native = native

    @classmethod
    def from_yaml(cls, text: str) -> Scenario:
        """Read the text of a scenario file.

        Raises:
            ScenarioError: with ``line`` and ``column``, and with ``field`` unless it is a syntax error.
        """
        return cls(_native.NativeScenario.from_yaml(text, True))

    @classmethod
    def from_file(cls, path: str | Path) -> Scenario:
        """Read a scenario file of at most 16 MiB.

        Raises:
            ScenarioError: as :meth:`from_yaml`.
            OSError: the file cannot be read.
        """
        return cls.from_yaml(_text_of(Path(path), _FILE_BYTES_MAX))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scenario:
        """Take a mapping with the fields of a scenario file.

        Raises:
            ScenarioError: with ``field``; a mapping has no lines.
        """
        try:
            text = json.dumps(data, allow_nan=False, default=_plain)
        except (TypeError, ValueError) as error:
            raise ScenarioError(f"is no scenario: {error}") from error
        return cls(_native.NativeScenario.from_yaml(text, False))

    @classmethod
    def from_map(cls, target: str, modules: str, *, name: str = "", **fields: Any) -> Scenario:
        """Take two drawings: ``o`` is a spot, letters are modules, ``-`` and ``|`` dock neighbours, ``#`` is a wall.

        Modules of one letter that are docked start as one configuration; ``s`` is a single module. ``fields`` are further fields
        of a scenario file, such as ``planner={"policy": "hungarian"}``. Drawings may begin on a second line, and be indented.

        Raises:
            ScenarioError: with ``field``.
        """
        drawn = {"name": name, "target": {"map": _drawing(target)}, "modules": {"map": _drawing(modules)}}
        return cls.from_dict({**drawn, **fields})

    @classmethod
    def generate(
        cls,
        modules: int,
        spots: int,
        *,
        seed: int,
        configuration_size: int | None = None,
        mixed: bool = False,
        degree: int = 3,
        apart: float = 3.0,
        touching: bool = False,
    ) -> Scenario:
        """Draw the scenario that ``formation generate`` prints for the same options.

        Args:
            modules, spots: How many.
            seed: The seed of the random numbers.
            configuration_size: Dock modules into configurations of so many.
            mixed: Mix singletons with configurations of 2 to 10 instead.
            degree: The most links of a spot or module, 3 or 4.
            apart: Width of the field in which modules start, as a multiple of the square root of their number, 1.5 to 100.
            touching: Draw starts as in the paper instead; modules may then overlap.

        Raises:
            OptionError: names what is out of its range.
        """
        if configuration_size is not None and mixed:
            raise OptionError("configuration_size and mixed exclude each other")
        width = None if touching else float(apart)
        return cls(_native.generate((modules, spots), configuration_size, mixed, degree, width, seed))

    @classmethod
    def import_map(
        cls,
        path: str | Path,
        *,
        modules: int,
        seed: int = 0,
        module_size: float = 1.0,
        unknown_is_free: bool = False,
    ) -> Scenario:
        """Draw modules and a target between the walls of a map: a YAML file of ROS 2 with its image, or a MovingAI ``.map``.

        Args:
            path: The map.
            modules: How many modules, and spots, on free cells of the largest connected part.
            seed: The seed of the random numbers.
            module_size: The size of a module in metres.
            unknown_is_free: Whether cells are open that the map does not know.

        Raises:
            OptionError: names what is wrong with the map or an option.
            OSError: the file cannot be read.
        """
        text = _text_of(Path(path), _native.map_bytes_max(path))
        return cls.from_yaml(_native.import_map(path, text, float(module_size), modules, seed, unknown_is_free))

    @classmethod
    def import_cgshop(cls, path: str | Path) -> Scenario:
        """Read an instance of the CG:SHOP Challenge 2021, Coordinated Motion Planning: a JSON file.

        Robot r is module r and goes to spot r, under the policy ``given``. Its targets may be in several parts, which can be
        planned but not formed. :meth:`Plan.cgshop_solution` has the steps for the contest's checker.

        Raises:
            OptionError: names what is wrong with the instance.
            OSError: the file cannot be read.
        """
        path = Path(path)
        if path.suffix != ".json":
            raise OptionError(f"{path}: the name of an instance ends in .json")
        text = _text_of(path, _native.map_bytes_max(path))
        return cls.from_yaml(_native.import_map(path, text, 1.0, None, 0, False))

    @property
    def name(self) -> str:
        """The scenario's name."""
        return self._native.name

    @property
    def module_ids(self) -> list[int]:
        """The identifiers of the M modules, ascending; the order of all arrays."""
        return self._native.module_ids()

    @property
    def spot_ids(self) -> list[int]:
        """The identifiers of the S spots, ascending; the order of all arrays."""
        return self._native.spot_ids()

    @property
    def starts(self) -> np.ndarray:
        """Where modules start: (M, 3) doubles x, y (units) and theta (radians)."""
        return array(self._native.starts(), "f8", 3)

    @property
    def spots(self) -> np.ndarray:
        """Where spots are: (S, 3) doubles x, y (units) and theta (radians)."""
        return array(self._native.spots(), "f8", 3)

    @property
    def edges(self) -> np.ndarray:
        """Docked spots: (E, 2) positions in ``spot_ids``."""
        return array(self._native.edges(), "i8", 2)

    @property
    def links(self) -> np.ndarray:
        """Modules docked at the start: (L, 2) positions in ``module_ids``."""
        return array(self._native.links(), "i8", 2)

    @property
    def utilities(self) -> np.ndarray:
        """What each spot (column) is worth to each module (row): (M, S) doubles, in units.

        These are the numbers by which the planner assigns single modules: the value of a spot less what going there costs
        (equations 1 to 3 of the paper; ``docs/planning.md``).
        """
        return array(self._native.utilities(), "f8", len(self.spot_ids))

    def oddities(self) -> list[str]:
        """What is valid and yet looks like a mistake, as ``formation check`` warns of it."""
        return self._native.oddities()

    def to_dict(self) -> dict[str, Any]:
        """The fields of a scenario file, with drawings as lists; :meth:`from_dict` reads them."""
        return json.loads(self._native.to_json())

    def to_yaml(self) -> str:
        """The text of a scenario file; :meth:`from_yaml` reads it back to the same scenario.

        JSON is YAML, so sections other than target and modules are written as JSON.
        """
        return self._native.to_yaml()

    def to_map(self) -> str:
        """The sections ``target`` and ``modules`` as drawings, as ``formation show`` prints them.

        Raises:
            ScenarioError: names what does not stand on the lattice.
        """
        return self._native.to_maps()

    def with_planner(self, **parameters: Any) -> Scenario:
        """The same scenario with other fields in its section ``planner``, such as ``policy="auction"``.

        A chain length that is not bounded counts as not given, so that the policy ``paper`` has its own bound.
        """
        data = self.to_dict()
        planner = data["planner"]
        if parameters.get("policy", planner["policy"]) != "paper":
            planner.pop("paper", None)
        if planner["d_max"] is None:
            del planner["d_max"]
        data["planner"] = {**planner, **parameters}
        if data["planner"]["policy"] != "given":
            for field in ("allocation", "detached"):
                data["target"].pop(field, None)
        return Scenario.from_dict(data)

    def plan(self, policy: Any = None) -> Plan:
        """The plan; see :func:`formation.plan`."""
        from .plans import plan

        return plan(self, policy=policy)

    def picture(self) -> Picture:
        """The modules where they start, and the spots."""
        return self.plan().before()

    def _repr_svg_(self) -> str:
        return self.picture().svg

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Scenario {self.name!r}: {len(self.module_ids)} modules, {len(self.spot_ids)} spots>"


def _drawing(text: str) -> str:
    """A drawing without the line end and the indentation that it has in a program."""
    return textwrap.dedent(text[1:] if text.startswith("\n") else text)


def _plain(value: Any) -> Any:
    """A number or an array of NumPy as Python's own."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{value!r} has no place in a scenario")


def _text_of(path: Path, bytes_max: int) -> str:
    with path.open("rb") as file:
        data = file.read(bytes_max + 1)
    if len(data) > bytes_max:
        raise ScenarioError(f"{path}: is larger than {bytes_max >> 20} MiB")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: is no UTF-8 text (byte {error.start + 1})") from error
