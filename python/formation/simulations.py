"""Simulated runs: many agents in one process, in virtual time, on a seeded network and with faults."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from collections.abc import Iterator

from . import _native
from ._arrays import frame
from .errors import OptionError
from .scenarios import Scenario

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Event", "Simulation", "fault_kinds", "simulate"]

# A value may contain spaces, and ends where the next key begins.
_FIELD = re.compile(r" (\w+)=(.*?)(?= \w+=|$)")


@dataclass(frozen=True)
class Event:
    """Something that happened in a run.

    Attributes:
        at_s: When, in seconds of virtual time.
        module: Who acts; ``None`` for faults and the announcement of a target.
        kind: What, such as ``claim``, ``agreed`` or ``crash``.
        data: The rest, as text.
    """

    at_s: float
    module: int | None
    kind: str
    data: dict[str, str] = field(default_factory=dict)

    @classmethod
    def _of(cls, at_s: float, line: str) -> Event:
        actor, _, words = line.strip().partition(" ")
        kind = words.split(" ", 1)[0]
        data = dict(_FIELD.findall(words[len(kind) :]))
        return cls(at_s, None if actor == "-" else int(actor), kind, data)


class Simulation:
    """One run, or several with seeds that follow each other. Everything that must always hold was checked."""

    def __init__(self, native: _native.NativeSimulation) -> None:
        self._native = native

    @property
    def runs(self) -> list[dict[str, Any]]:
        """For each seed: ``seed``, ``modules``, ``spots``, ``running`` (at the end), ``ending`` (``formed``,
        ``waiting_for_quorum`` or ``neither``), ``recovery_s`` (since the last fault), ``messages``, ``epochs`` and
        ``violations``.
        """
        return json.loads(self._native.runs_json())

    @property
    def violations(self) -> list[dict[str, Any]]:
        """What was violated: ``seed``, ``at_s``, ``kind`` and ``detail``; empty if all is well."""
        return [{"seed": run["seed"], **one} for run in self.runs for one in run["violations"]]

    @property
    def events(self) -> Iterator[Event]:
        """The events of a single run in order; none if there were several seeds."""
        for index in range(self._native.event_count()):
            event = self._native.event(index)
            if event is not None:
                yield Event._of(*event)

    def to_dict(self) -> dict[str, Any]:
        """The object that ``formation simulate --json`` prints."""
        return json.loads(self._native.to_json())

    def to_frame(self) -> pd.DataFrame:
        """A row for each seed, with the number of violations."""
        runs = [{**run, "violations": len(run["violations"])} for run in self.runs]
        return frame(runs, list(runs[0]))

    def __str__(self) -> str:
        return self._native.text()

    def __repr__(self) -> str:
        return f"<Simulation: {self._native.text().splitlines()[0]}>"


def simulate(
    scenario: Scenario | None = None,
    *,
    seed: int = 0,
    seeds: int = 1,
    faults: str = "mixed",
    modules: tuple[int, int] = (5, 40),
) -> Simulation:
    """Run agents in virtual time. Equal arguments give equal runs, and the same as ``formation simulate``.

    Args:
        scenario: Its modules and target in every run; ``None`` draws a scenario from each seed.
        seed: The first seed.
        seeds: How many runs. Events are kept of a single one only.
        faults: One of :func:`fault_kinds`; ``docs/running.md`` describes them.
        modules: The fewest and the most modules of a drawn scenario.

    Raises:
        OptionError: an argument is out of its range.
        MotionError: no module of the scenario would move.
        ScenarioError: its target is in several parts, and modules dock into one formation.
    """
    if seeds < 1 or seed < 0:
        raise OptionError(f"seed and seeds: must be at least 0 and 1, got {seed} and {seeds}")
    planned = None if scenario is None else scenario._native.plan()
    return Simulation(_native.simulate(planned, modules, seed, seeds, faults))


def fault_kinds() -> list[str]:
    """The kinds of faults that :func:`simulate` knows."""
    return _native.fault_kinds()
