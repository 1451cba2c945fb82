"""The tables of comparisons, with peers that are played here: the real ones are optional."""

import json
import sys
import types

from formation import benchmarks


class PlayedLacam:
    """A solver with the interface of LaCAM: the only robot goes along its column, then along its row."""

    def __init__(self, grid, starts, goals, seed):
        assert all(grid[y][x] for y, x in (*starts, *goals)), "no robot is on an obstacle"
        self.at, self.goals = list(starts), list(goals)

    def step(self, deadline_ms):
        (y, x), (to_y, to_x) = self.at[0], self.goals[0]
        if y != to_y:
            return [(y + (1 if to_y > y else -1), x)]
        return [(y, x + (1 if to_x > x else -1))]

    def reroot(self, at):
        self.at = at

    def is_solved(self, at):
        return at == self.goals

    def close(self):
        pass


def test_what_is_absent_is_named(capsys, monkeypatch):
    monkeypatch.setattr(benchmarks, "TABLES", {"motion": (benchmarks.motion, {"no_such_module": "no-such-package"})})
    assert benchmarks.main([]) == 0
    assert "## motion\n\nnot compared: no-such-package is not installed" in capsys.readouterr().out


def test_rows_in_which_ours_is_behind_come_first(capsys, monkeypatch, tmp_path):
    def table(seeds):
        assert list(seeds) == [1, 2]
        yield benchmarks._row("near", "time, s", 2.0, 1.0, "peer")
        yield benchmarks._row("far", "time, s", 1.0, 4.0, "peer")
        yield benchmarks._row("worst", "spots (more)", 1.0, 3.0, "peer", more=True)

    monkeypatch.setattr(benchmarks, "TABLES", {"played": (table, {"pytest": "pytest"})})
    assert benchmarks.main(["--seeds", "2", "--json", str(tmp_path / "rows.json")]) == 0
    printed = capsys.readouterr().out
    assert [line.split(" | ")[0] for line in printed.splitlines()[-3:]] == ["| worst", "| near", "| far"]
    assert "processors" in printed and "pytest " in printed
    rows = json.loads((tmp_path / "rows.json").read_text())["played"]
    assert [row["behind"] for row in rows] == [3.0, 2.0, 0.25]


def test_results_of_lacam_are_judged(monkeypatch):
    monkeypatch.setitem(sys.modules, "rt_lacam", types.SimpleNamespace(RTLaCAM=PlayedLacam))
    drawn = {"name": "one", "starts": [[0, 1]], "targets": [[3, 5]], "obstacles": [[9, 9]]}
    monkeypatch.setattr(benchmarks, "draw", lambda *_: drawn)
    monkeypatch.setattr(benchmarks, "KINDS", ["played"])
    rows = list(benchmarks.motion([1], [(10, 0.1)]))
    assert [row["quantity"] for row in rows] == ["makespan, steps", "sum of arrivals, steps", "time, s"]
    assert rows[0]["ours"] == rows[0]["theirs"] == 7 and rows[0]["behind"] == 1
    assert rows[0]["note"].startswith("ours valid, LaCAM's valid in the model of cells; as squares 0 pairs")


def test_kinds_are_drawn_to_their_share():
    for kind in benchmarks.KINDS:
        drawn = benchmarks.draw(kind, 14, 0.9, 2)
        cells = {tuple(cell) for cell in drawn["obstacles"]}
        for field in ("starts", "targets"):
            robots = {tuple(cell) for cell in drawn[field]}
            assert len(robots) == len(drawn[field]) == drawn["meta"]["number_of_robots"] and not robots & cells
        assert drawn["meta"]["number_of_robots"] == int(0.9 * (14 * 14 - len(cells)))
        assert drawn == benchmarks.draw(kind, 14, 0.9, 2) and drawn != benchmarks.draw(kind, 14, 0.9, 3)
