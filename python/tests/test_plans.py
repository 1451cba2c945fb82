"""Plans, simulated runs, traces and pictures."""

import ast
import pathlib
import sys
import threading
import time
import xml.etree.ElementTree as xml

import formation
import pytest

CROSSING = formation.Scenario.from_map("o-o-o-o\n|\no", "A-A   s\n\ns   s", name="crossing")


def test_tables_agree_with_the_numbers():
    plan = formation.plan(CROSSING)
    table = plan.to_frame()
    assert table["distance"].sum() == pytest.approx(plan.total_distance, abs=1e-5)
    assert dict(zip(table["module"], table["spot"])) == plan.assignments
    motion = plan.motion_frame()
    assert motion["t"].max() == plan.makespan >= plan.makespan_bound
    last = plan.waypoints(1)[-1]
    spot = CROSSING.spot_ids.index(plan.assignments[1])
    assert last[:2].tolist() == CROSSING.spots[spot][:2].tolist()
    assert plan.numbers["total_utility"] == plan.to_dict()["total_utility"] == plan.total_utility


def test_a_module_without_a_spot_has_none():
    plan = formation.plan(formation.Scenario.from_map("o-o", "s s s"))
    assert len(plan.assignments) == 2 and plan.to_frame()["spot"].isna().sum() == 1
    for ask in [plan.explain, plan.explain_text, plan.waypoints]:
        with pytest.raises(formation.PlanError, match="no module 99"):
            ask(99)


def test_what_cannot_move_is_refused():
    walled = formation.Scenario.from_yaml(
        "target: {spots: [{id: 1, x: 9, y: 0}]}\nsingletons: [{id: 1, x: 0, y: 0}]\n"
        "arena: {x: 4.5, y: 0, width: 12, height: 4}\nobstacles: [{x: 5, y: 0, width: 1, height: 4}]\n"
    )
    with pytest.raises(formation.MotionError, match="no module would move"):
        formation.check(walled)
    with pytest.raises(formation.MotionError):
        formation.simulate(walled)
    with pytest.raises(formation.OptionError, match="drive"):
        formation.check(CROSSING, drive="legs")


def test_pictures_are_svg():
    plan = formation.plan(CROSSING)
    for picture in [plan.before(), plan.after(), plan.film(), plan.film(dark=True)]:
        assert xml.fromstring(picture._repr_svg_()).tag.endswith("svg")
    assert "data:image/svg+xml;base64," in plan.film()._repr_html_()
    assert plan.page().lstrip().lower().startswith("<!doctype html>")


@pytest.mark.parametrize("seed", range(12))
def test_a_planned_course_passes_the_judge_of_traces(seed):
    scenario = formation.Scenario.generate(12, 12, seed=seed, mixed=True)
    plan = formation.plan(scenario)
    verdict = formation.verify(scenario, plan.trace())
    assert verdict.outcome == "COMPLETE", verdict
    assert verdict.assignments == plan.assignments


def test_the_judge_finds_what_is_wrong():
    scenario = formation.Scenario.from_map(
        "o-o", "s     s", name="two", obstacles=[{"x": 0, "y": 8, "width": 1, "height": 1}]
    )
    rows = list(formation.plan(scenario).trace())
    assert formation.verify(scenario, rows).violations == []

    def found(changed):
        verdict = formation.verify(scenario, changed)
        assert verdict.outcome == "FAILED"
        return "; ".join(verdict.violations)

    assert "module 2 is not in the trace" in found([row for row in rows if row["module"] == 1])
    assert "module 5 is not in the scenario" in found([*rows, {**rows[0], "module": 5}])
    assert "not docked" in found([{**row, "links": []} for row in rows])
    end = rows[-1]["t"]
    away = [{**row, "t": end + 1, "x": 0.0, "y": 20.0} for row in rows[-1:]]
    assert "filled" in found([*rows, *away])
    # Through the obstacle and back, and through the other module.
    start = {row["module"]: row for row in reversed(rows)}
    detour = [{**start[1], "t": -4.0}, {**start[1], "t": -3.0, "x": 0.0, "y": 12.0}, {**start[1], "t": -1.0}]
    assert "module 1 touches the obstacle" in found([*detour, *rows])
    other = [{**start[2], "t": -4.0}, {**start[2], "t": -3.0, "x": start[1]["x"] - 2.0}, {**start[2], "t": -1.0}]
    stands = [{**start[1], "t": -5.0}]
    assert "modules 1 and 2 overlap" in found([*other, *stands, *rows]).replace("module 1 and module 2", "modules 1 and 2")


@pytest.mark.parametrize("text", ["{", "[]", '{"t": 1}', '{"t": 1, "module": -1, "x": 0, "y": 0, "theta": 0}'])
def test_a_line_that_is_no_state_is_named(text):
    with pytest.raises(formation.TraceError) as caught:
        formation.verify(CROSSING, f"\n{text}")
    assert caught.value.line == 2


def test_events_come_in_order_with_their_data():
    run = formation.simulate(CROSSING, seed=1, faults="crash")
    events = list(run.events)
    assert [event.at_s for event in events] == sorted(event.at_s for event in events)
    assert {"target_announced", "claim", "agreed", "settled", "crash"} <= {event.kind for event in events}
    settled = [event for event in events if event.kind == "settled"]
    assert all(event.module in CROSSING.module_ids and int(event.data["spot"]) for event in settled)
    assert run.violations == [] and len(run.to_frame()) == 1


def test_options_of_a_simulation_are_checked():
    for wrong in [{"faults": "x"}, {"seeds": 0}, {"seed": -1}, {"modules": (9, 5)}, {"modules": (1, 10_000)}]:
        with pytest.raises(formation.OptionError):
            formation.simulate(**wrong)


def test_other_threads_run_while_rust_computes():
    scenario = formation.Scenario.generate(120, 120, seed=1)
    counted, started, done = [0], threading.Event(), threading.Event()

    def count():
        started.set()
        while not done.is_set():
            counted[0] += 1
            time.sleep(0)

    interval = sys.getswitchinterval()
    thread = threading.Thread(target=count)
    thread.start()
    started.wait()
    # A thread now runs only while another one gives the interpreter up by itself, as `plan` has to.
    sys.setswitchinterval(1_000)
    try:
        before = counted[0]
        # The first calls may end before the system has woken the other thread.
        for _ in range(200):
            formation.plan(scenario)
            if counted[0] > before:
                break
        during = counted[0] - before
    finally:
        sys.setswitchinterval(interval)
        done.set()
        thread.join()
    assert during > 0


def test_nothing_is_imported_before_it_is_needed():
    package = pathlib.Path(formation.__file__).parent
    for path in package.glob("*.py"):
        tree = ast.parse(path.read_text())
        names = {name for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom)) for name in imported(node)}
        assert not names & {"numpy", "pandas", "rclpy", "matplotlib"}, path


def imported(node):
    if isinstance(node, ast.Import):
        return [alias.name.split(".")[0] for alias in node.names]
    return [(node.module or "").split(".")[0]] if node.level == 0 else []


def test_the_stub_lists_what_the_extension_module_has():
    native = sys.modules["formation._native"]
    tree = ast.parse((pathlib.Path(formation.__file__).parent / "_native.pyi").read_text())
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            listed = {one.name for one in node.body if isinstance(one, ast.FunctionDef)}
            known = {name for name in vars(getattr(native, node.name)) if not name.startswith("__")}
            assert listed == known, node.name
    listed = {node.name for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert listed == {name for name in dir(native) if not name.startswith("__")}
