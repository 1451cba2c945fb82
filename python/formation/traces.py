"""Traces: where modules were, as ``formation run --trace`` writes it, judged against a scenario."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from collections.abc import Iterable, Mapping

from . import _native
from .scenarios import Scenario

__all__ = ["Verdict", "verify"]


@dataclass(frozen=True)
class Verdict:
    """What a trace shows.

    Attributes:
        outcome: ``COMPLETE``, ``PARTIAL`` (all spots are filled that the modules suffice for) or ``FAILED``.
        assignments: The spot on which each module ended.
        open_spots: The spots that no module fills.
        violations: What is wrong, one sentence each.
    """

    outcome: str
    assignments: dict[int, int]
    open_spots: list[int]
    violations: list[str]


def verify(scenario: Scenario, trace: str | Path | Iterable[Mapping[str, Any]]) -> Verdict:
    """Judge whether modules end on the spots, docked, and never touched each other, an obstacle or a wall.

    The judge shares nothing with the planner, the agents or the verifier that listens to topics.

    Args:
        scenario: What was to be formed.
        trace: A file, its text, or its rows: ``t`` (s), ``module``, ``x``, ``y`` (units), ``theta`` (radians), ``links`` (the
            modules that it is docked to). Between two of its rows a module moves straight on.

    Raises:
        TraceError: with ``line``.
        OSError: the file cannot be read.
    """
    if isinstance(trace, Path):
        trace = trace.read_text(encoding="utf-8")
    if not isinstance(trace, str):
        trace = "\n".join(json.dumps(dict(row)) for row in trace)
    judged = json.loads(_native.verify_json(scenario._native, trace))
    judged["assignments"] = {int(module): spot for module, spot in judged["assignments"].items()}
    return Verdict(**judged)
