"""Runs the notebooks, and says how long each took. A cell that fails ends it.

Usage: run_notebooks.py [NOTEBOOK...]
"""

import os
import pathlib
import sys
import time

os.environ.setdefault("MPLBACKEND", "agg")
# Nobody debugs the kernel.
os.environ.setdefault("PYDEVD_DISABLE_FILE_VALIDATION", "1")

import nbformat
from nbclient import NotebookClient

FOLDER = pathlib.Path(__file__).resolve().parents[1] / "notebooks"
CELL_LIMIT_S = 120


def main():
    named = [pathlib.Path(name) for name in sys.argv[1:]]
    for path in named or sorted(FOLDER.glob("*.ipynb")):
        begun = time.monotonic()
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        # The kernel listens on loopback.
        folder = {"metadata": {"path": str(FOLDER)}}
        NotebookClient(notebook, timeout=CELL_LIMIT_S, resources=folder).execute()
        print(f"{path.name}: {len(notebook.cells)} cells in {time.monotonic() - begun:.1f} s", flush=True)


main()
