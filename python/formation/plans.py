"""Plans: which module takes which spot, and how it gets there."""

from __future__ import annotations

import json
import operator
from functools import cached_property
from typing import TYPE_CHECKING, Any, Union
from collections.abc import Callable, Iterator, Mapping

from . import _native
from ._arrays import array, frame
from .errors import OptionError, PlanError
from .figures import Film, Picture
from .scenarios import Scenario

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

__all__ = ["Plan", "Policy", "check", "explain", "instance", "plan"]

#: A name of a policy, or a function from an instance to the spot of each module. It is evaluated, which Python 3.9 does not do
#: with `|`.
Policy = Union[str, Callable[[Mapping[str, Any]], Mapping[int, int]]]  # noqa: UP007


class Plan:
    """The plan of a scenario, checked by the verifier. Every module that takes part computes the same one.

    Attributes:
        scenario: What was planned for.
    """

    def __init__(self, scenario: Scenario, native: _native.NativePlan) -> None:
        self.scenario = scenario
        self._native = native

    @property
    def assignments(self) -> dict[int, int]:
        """The spot of each module that gets one, ascending by module."""
        return dict(self._native.assignments())

    @property
    def complete(self) -> bool:
        """Whether all spots are filled, and connected, that the modules suffice for."""
        return self._native.is_complete()

    @property
    def hole(self) -> str | None:
        """What is wrong with the spots that are filled; ``None`` if the plan is complete."""
        return self._native.hole()

    @property
    def warnings(self) -> list[str]:
        """What ``formation plan`` warns of."""
        return self._native.warnings()

    @cached_property
    def numbers(self) -> dict[str, Any]:
        """What the plan keeps, breaks and costs: the keys of ``formation plan --json`` without turns and motion.

        ``total_utility`` and ``total_distance`` are in units, ``planning_us`` in microseconds.
        """
        return json.loads(self._native.numbers_json())

    @property
    def total_utility(self) -> float:
        """The sum of the utilities, in units."""
        return self.numbers["total_utility"]

    @property
    def total_distance(self) -> float:
        """The sum of the straight distances, in units."""
        return self.numbers["total_distance"]

    @property
    def makespan(self) -> int | None:
        """Steps until the last module arrives; ``None`` without paths."""
        return (self._native.makespan() or (None,))[0]

    @property
    def makespan_bound(self) -> int | None:
        """No plan has fewer steps for these assignments; ``None`` without paths."""
        return (self._native.makespan() or (None, None))[1]

    def waypoints(self, module: int) -> np.ndarray:
        """The path of a module: (T, 4) doubles x, y (units), theta (radians) and plan time (steps).

        (0, 4) where the module has no path.

        Raises:
            PlanError: there is no such module.
        """
        if module not in self.scenario.module_ids:
            raise PlanError(f"there is no module {module}")
        return array(self._native.waypoints(module), "f8", 4)

    def to_dict(self) -> dict[str, Any]:
        """The object that ``formation plan --json`` prints; ``docs/json.md`` describes it."""
        return json.loads(self._native.to_json())

    def to_json(self) -> str:
        """The text that ``formation plan --json`` prints."""
        return self._native.to_json()

    def cgshop_solution(self) -> dict[str, Any]:
        """The paths as a solution of the CG:SHOP Challenge 2021, as ``formation plan --cgshop`` prints it.

        ``instance`` is the name of the scenario, ``steps`` has for each step the direction (``N``, ``E``, ``S`` or ``W``) of each
        robot that moves by a cell, by its number: that of its module, as text.

        Raises:
            PlanError: there are no paths, or a step is none from a cell to the next, as of a module that turns.
        """
        return json.loads(self._native.cgshop_json())

    def to_frame(self) -> pd.DataFrame:
        """A row for each module: module, spot (``NA`` without one), x, y, theta at the start, and the distance in units."""
        places = dict(zip(self.scenario.spot_ids, self.scenario.spots))
        rows = []
        for module, start in zip(self.scenario.module_ids, self.scenario.starts):
            spot = self.assignments.get(module)
            distance = None if spot is None else float(((places[spot] - start)[:2] ** 2).sum() ** 0.5)
            rows.append((module, spot, *map(float, start), distance))
        made = frame(rows, ["module", "spot", "x", "y", "theta", "distance"])
        return made.astype({"spot": "Int64"})

    def motion_frame(self) -> pd.DataFrame:
        """A row for each waypoint: module, x, y (units), theta (radians), t (steps)."""
        rows = [(module, *row) for module in self.scenario.module_ids for row in self.waypoints(module).tolist()]
        return frame(rows, ["module", "x", "y", "theta", "t"])

    def explain(self, module: int) -> dict[str, Any]:
        """Why a module gets its spot, or none: the object that ``formation explain --json`` prints.

        Raises:
            PlanError: there is no such module.
        """
        return json.loads(self._native.explain_json(module))

    def explain_text(self, module: int) -> str:
        """Why a module gets its spot, or none, in sentences."""
        return self._native.explain_text(module)

    def check(self, drive: str = "holonomic") -> dict[str, Any]:
        """The object that ``formation check --json`` prints.

        Args:
            drive: ``holonomic``, or ``differential`` for robots that turn in place.

        Raises:
            ScenarioError: the plan takes longer than real processes are given.
            MotionError: no module would move, or differential drives cannot carry it out.
            OptionError: there is no such drive.
        """
        if drive not in ("holonomic", "differential"):
            raise OptionError(f"drive: must be holonomic or differential, got {drive!r}")
        return json.loads(self._native.check_json(drive == "differential"))

    def course(self) -> Iterator[dict[str, Any]]:
        """What happens when simulated drives carry the plan out: entries with ``at_ms``, as in the page of a report."""
        yield from json.loads(self._native.course_json())

    def trace(self) -> Iterator[dict[str, Any]]:
        """Where modules are when simulated drives carry the plan out, as rows of a trace that :func:`formation.verify` judges."""
        links: dict[int, list[int]] = {}
        for entry in self.course():
            change = entry.get("state") or entry.get("pose")
            if change is None:
                continue
            module, pose = change["module"], change["pose"]
            links[module] = change.get("links", links.get(module, []))
            x, y, theta = (pose[axis] / 1e6 for axis in ("x", "y", "theta"))
            yield {"t": entry["at_ms"] / 1e3, "module": module, "x": x, "y": y, "theta": theta, "links": links[module]}

    def before(self) -> Picture:
        """The modules where they start."""
        return Picture(self._native.picture_before())

    def after(self) -> Picture:
        """The modules where they end, with kept, broken and new links."""
        return Picture(self._native.picture_after())

    def film(self, *, dark: bool = False) -> Film:
        """An animated picture of the turns and the motion."""
        return Film(self._native.film(dark))

    def page(self) -> str:
        """A page of HTML that plays the plan, as ``formation plan --report`` writes it."""
        return self._native.page()

    def _repr_svg_(self) -> str:
        return self.after().svg

    def __repr__(self) -> str:
        filled, spots = len(self._native.assignments()), len(self.scenario.spot_ids)
        return f"<Plan of {self.scenario.name!r}: {filled} of {spots} spots filled>"


def plan(scenario: Scenario, *, policy: Policy | None = None) -> Plan:
    """Plan which module takes which spot, and paths without contact.

    The planner is the one that ``formation plan`` and every module run, so the numbers are the same, bit for bit.

    Args:
        scenario: What to plan for.
        policy: Another policy than the scenario's, by its name (``formation policies`` lists them), or a function.
            It gets the :func:`instance` and returns the spot of each module, ``{module: spot}``. As many spots must be filled as
            the modules suffice for, and connected. What it decides is planned and checked like any other plan.

    Raises:
        PlanError: the plan does not keep its guarantees, or the function returns no allocation.
        ScenarioError: there is no such policy.
    """
    if callable(policy):
        native = scenario._native.plan_by_allocation(_allocation(policy(instance(scenario))))
        return Plan(scenario, native)
    if policy is not None:
        scenario = scenario.with_planner(policy=policy)
    return Plan(scenario, scenario._native.plan())


def instance(scenario: Scenario) -> dict[str, Any]:
    """What a policy decides on: the object that a ``--policy-program`` reads, with the utilities. Lengths are in units, headings
    in radians.

    ``modules``: ``id``, ``x``, ``y``, ``theta``, ``configuration`` and ``leader`` (or ``None``), ``links`` (the modules that it
    is docked to), ``pin`` (the spot that it keeps), ``reachable`` (whether a way leads to the target). ``spots``: ``id``, ``x``,
    ``y``, ``theta``, ``value`` (its betweenness). ``edges``: pairs of adjacent spots. ``weights``, ``keep_all_spots``,
    ``body_width``, ``obstacles``, ``arena``: as in the scenario. ``utilities``: a row for each module, a column for each spot, in
    these orders.
    """
    return {**json.loads(scenario._native.instance_json()), "utilities": scenario.utilities}


def _allocation(answer: Any) -> list[tuple[int, int]]:
    """The pairs of what a policy returns."""
    wrong = f"the policy must return {{module: spot}} of identifiers, got {answer!r:.200}"
    try:
        pairs = [(operator.index(module), operator.index(spot)) for module, spot in dict(answer).items()]
    except (TypeError, ValueError) as error:
        raise PlanError(wrong) from error
    if not all(0 <= number < 2**32 for pair in pairs for number in pair):
        raise PlanError(wrong)
    return pairs


def explain(scenario: Scenario, module: int) -> dict[str, Any]:
    """Why a module gets its spot in the plan, or none; see :meth:`Plan.explain`."""
    return plan(scenario).explain(module)


def check(scenario: Scenario, *, drive: str = "holonomic") -> dict[str, Any]:
    """What ``formation check --json`` prints; see :meth:`Plan.check`. The key ``complete`` tells whether the plan has a hole."""
    return plan(scenario).check(drive)
