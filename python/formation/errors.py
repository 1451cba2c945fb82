"""The exceptions of this package. All of them are :class:`FormationError`."""

from __future__ import annotations

__all__ = ["FormationError", "MotionError", "OptionError", "PlanError", "ScenarioError", "TraceError"]


class FormationError(ValueError):
    """What is wrong, and where.

    Attributes:
        message: What is wrong, without the place.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message


class ScenarioError(FormationError):
    """A scenario is refused.

    Attributes:
        message: What is wrong.
        field: The path of the field, such as ``configurations[0].modules[2].id``; ``None`` for a syntax error.
        line, column: The place in the text, from 1; ``None`` where the scenario was no text, or the field is missing in it.
    """

    def __init__(
        self, message: str, field: str | None = None, line: int | None = None, column: int | None = None
    ) -> None:
        super().__init__(message)
        self.field = field
        self.line = line
        self.column = column

    def __str__(self) -> str:
        place = "" if self.line is None else f"line {self.line} column {self.column}: "
        field = "" if self.field is None else f"{self.field}: "
        return f"{place}{field}{self.message}"


class OptionError(FormationError):
    """An argument is out of its range, or a map cannot be imported."""


class PlanError(FormationError):
    """A plan is refused: it does not keep its guarantees, or lacks the module that is asked for."""


class MotionError(FormationError):
    """No module would move by a plan, or its robots cannot carry it out."""


class TraceError(FormationError):
    """A trace cannot be read.

    Attributes:
        line: The line, from 1.
    """

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line

    def __str__(self) -> str:
        return f"line {self.line}: {self.message}"
