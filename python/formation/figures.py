"""Pictures and films for notebooks: SVG in, shown by Jupyter."""

from __future__ import annotations

import base64
from pathlib import Path

__all__ = ["Film", "Picture"]


class Picture:
    """An SVG picture, which a notebook shows.

    Attributes:
        svg: The text of the picture.
    """

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: str | Path) -> None:
        """Write the picture to a file."""
        Path(path).write_text(self.svg, encoding="utf-8")


class Film(Picture):
    """An animated SVG picture.

    A notebook shows it as an image, so that its style sheet stays its own, and it plays without scripts.
    """

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.svg.encode()).decode()
        return f'<img alt="the film of a plan" src="data:image/svg+xml;base64,{data}">'
