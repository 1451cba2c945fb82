"""What the tests share: the launcher, which FORMATION_PROGRAM names, and the scenarios that ship with the suite."""

import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENARIOS = sorted((ROOT / "launch_scripts/scenarios").rglob("*.yaml"))


class Launcher:
    """The command line."""

    def __init__(self, path):
        self.path = path

    def run(self, *arguments, text=None):
        """Runs a command, and returns its status and what it wrote to its two outputs."""
        command = [self.path, *map(str, arguments)]
        return subprocess.run(command, input=text, capture_output=True, text=True, check=False, timeout=120)

    def printed(self, *arguments, text=None):
        """What a command that finds at most a hole prints."""
        done = self.run(*arguments, text=text)
        assert done.returncode in (0, 1) and done.stdout, (arguments, done.stderr)
        return done.stdout


@pytest.fixture(scope="session")
def launcher():
    path = os.environ.get("FORMATION_PROGRAM", str(ROOT / "target/debug/formation"))
    if not pathlib.Path(path).is_file():
        pytest.fail(f"{path} is missing; build it, or name it in FORMATION_PROGRAM")
    return Launcher(path)


@pytest.fixture(params=SCENARIOS, ids=lambda path: path.stem)
def shipped(request):
    return request.param
