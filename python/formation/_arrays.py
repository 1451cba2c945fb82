"""NumPy and pandas, which are imported when they are first needed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np


def array(data: bytes, dtype: str, columns: int | None = None) -> np.ndarray:
    """The numbers in these bytes; with columns, as rows of so many. The array is read-only."""
    numpy = _imported("numpy", "arrays")
    flat = numpy.frombuffer(data, dtype=dtype)
    return flat if columns is None else flat.reshape(-1, columns)


def frame(rows: Any, columns: list[str]) -> Any:
    """A data frame of rows."""
    return _imported("pandas", "frames").DataFrame(rows, columns=columns)


def _imported(name: str, extra: str) -> Any:
    try:
        return __import__(name)
    except ImportError as error:
        raise ImportError(f"{name} is not installed: pip install 'formation[{extra}]'") from error
