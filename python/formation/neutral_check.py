"""A checker of allocations and motion that shares nothing with the planner: it imports the standard library alone.

    python3 neutral_check.py INSTANCE.json RESULT.json [--model bodies|cells]

It judges the result of any planner, which ``docs/neutral_format.md`` describes, and prints what is wrong and what the result
costs. The status is 0 for a valid result, 1 for another one, 2 for what cannot be read. In the model ``bodies`` modules are
squares or circles that move straight on between waypoints and never overlap. In the model ``cells``, that of multi-agent path
finding, they are at one cell at each whole time, no two at the same one, and no two change places.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import defaultdict

__all__ = ["MODELS", "FormatError", "judge"]

MODELS = ("bodies", "cells")
#: How far a module may be from where it should be, in units or radians.
PLACE = 5e-3
#: Bodies that overlap by less than this touch, in units.
TOUCH = 1e-6
#: Turning bodies are compared at moments between which no corner moves by more than this, in units.
STRIDE = 0.02


class FormatError(ValueError):
    """An instance or a result that is not of the format."""


def judge(instance, result, model="bodies"):
    """What is wrong with a result, and what it costs: ``valid``, ``violations`` (sentences), ``measures``.

    Raises:
        FormatError: the instance or the result is not of the format.
    """
    if model not in MODELS:
        raise FormatError(f"model: must be one of {', '.join(MODELS)}, got {model!r}")
    problem = _Problem(instance)
    allocation, violations = _allocation(problem, result)
    measures = _allocation_measures(problem, allocation)
    if "motion" in result:
        paths = _paths(problem, result)
        violations += _ends(problem, allocation, paths)
        violations += _speeds(problem, paths)
        if model == "cells":
            violations += _cells(problem, paths)
        else:
            violations += _contacts(problem, paths, _docked(problem, result))
            violations += _walls(problem, paths)
        measures.update(_motion_measures(paths))
    return {"valid": not violations, "violations": violations, "measures": measures}


class _Problem:
    def __init__(self, instance):
        with _reading("instance"):
            self.modules = {one["id"]: one for one in instance["modules"]}
            self.spots = {one["id"]: one for one in instance["spots"]}
            self.edges = {frozenset(edge) for edge in instance["edges"]}
            self.links = {
                frozenset((one["id"], other)) for one in instance["modules"] for other in one.get("links", ())
            }
            self.width = float(instance.get("body_width", 0.9))
            self.is_round = instance.get("body", "square") == "circle"
            speed = instance.get("max_speed", 1.0)
            self.speed = math.inf if speed is None else float(speed)
            self.obstacles = [_box(area) for area in instance.get("obstacles", ())]
            self.arena = None if instance.get("arena") is None else _box(instance["arena"])
            self.given = {one["module"]: one["spot"] for one in instance.get("given") or ()}
            if len(self.modules) < len(instance["modules"]) or len(self.spots) < len(instance["spots"]):
                raise FormatError("instance: an identifier is used twice")


class _reading:
    """Turns what a missing or odd field raises into an error of the format."""

    def __init__(self, what):
        self.what = what

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if isinstance(error, FormatError) or error is None:
            return
        if isinstance(error, KeyError):
            raise FormatError(f"{self.what}: the field {error} is missing") from error
        if isinstance(error, (TypeError, ValueError, AttributeError)):
            raise FormatError(f"{self.what}: {error}") from error


def _box(area):
    x, y, width, height = (float(area[field]) for field in ("x", "y", "width", "height"))
    return (x - width / 2, y - height / 2, x + width / 2, y + height / 2)


# Who takes which spot.


def _allocation(problem, result):
    with _reading("result"):
        pairs = [(one["module"], one["spot"]) for one in result["allocation"]]
    violations, spot_of, holder = [], {}, {}
    for module, spot in pairs:
        if module not in problem.modules:
            violations.append(f"allocation: there is no module {module}")
        elif spot not in problem.spots:
            violations.append(f"allocation: there is no spot {spot}")
        elif module in spot_of:
            violations.append(f"allocation: module {module} has two spots, {spot_of[module]} and {spot}")
        elif spot in holder:
            violations.append(f"allocation: modules {holder[spot]} and {module} both have spot {spot}")
        else:
            spot_of[module], holder[spot] = spot, module
    able = [id for id, module in problem.modules.items() if module.get("reachable", True)]
    wanted = min(len(able), len(problem.spots))
    if not violations and len(spot_of) < wanted:
        violations.append(f"allocation: {len(spot_of)} modules have a spot; {wanted} can have one")
    for id, module in problem.modules.items():
        pin = module.get("pin")
        if pin is not None and spot_of.get(id) != pin:
            violations.append(f"allocation: module {id} keeps spot {pin}, and has {spot_of.get(id, 'none')}")
    for module, spot in problem.given.items():
        if spot_of.get(module) != spot:
            violations.append(f"allocation: module {module} is to have spot {spot}, and has {spot_of.get(module, 'none')}")
    return spot_of, violations


def _allocation_measures(problem, spot_of):
    def way(module, spot):
        start, end = problem.modules[module], problem.spots[spot]
        return math.hypot(start["x"] - end["x"], start["y"] - end["y"])

    ways = [way(module, spot) for module, spot in spot_of.items()]
    kept = defaultdict(set)
    for link in problem.links:
        one, other = sorted(link)
        if one in spot_of and other in spot_of and frozenset((spot_of[one], spot_of[other])) in problem.edges:
            kept[one].add(other)
            kept[other].add(one)
    largest, seen = 0, set()
    for first in kept:
        if first in seen:
            continue
        group, open_modules = {first}, [first]
        while open_modules:
            for other in kept[open_modules.pop()] - group:
                group.add(other)
                open_modules.append(other)
        seen |= group
        largest = max(largest, len(group))
    return {
        "placed": len(spot_of),
        "distance": math.fsum(ways),
        "longest": max(ways, default=0.0),
        "kept_links": sum(map(len, kept.values())) // 2,
        "largest_block": largest,
    }


# Where modules are, and when.


def _paths(problem, result):
    with _reading("result"):
        paths = {}
        for entry in result["motion"]:
            points = [tuple(map(float, point)) for point in entry["waypoints"]]
            if entry["module"] not in problem.modules:
                raise FormatError(f"result: motion of module {entry['module']}, which there is not")
            if entry["module"] in paths:
                raise FormatError(f"result: module {entry['module']} has two motions")
            if not points or any(len(point) != 4 or not all(map(math.isfinite, point)) for point in points):
                raise FormatError(f"result: module {entry['module']}: waypoints are [x, y, theta, t], at least one")
            if any(later[3] <= point[3] for point, later in zip(points, points[1:])):
                raise FormatError(f"result: module {entry['module']}: the times of waypoints must ascend")
            paths[entry["module"]] = _turning_the_shorter_way(points)
    for id, module in problem.modules.items():
        paths.setdefault(id, [(module["x"], module["y"], module.get("theta", 0.0), 0.0)])
    return paths


def _turning_the_shorter_way(points):
    """Headings that change by at most half a turn from one waypoint to the next."""
    turned = points[:1]
    for point in points[1:]:
        before = turned[-1][2]
        turns = round((point[2] - before) / (2 * math.pi))
        turned.append((*point[:2], point[2] - 2 * math.pi * turns, point[3]))
    return turned


def _turned(one, other):
    """How far two headings are apart, in radians."""
    return abs((one - other + math.pi) % (2 * math.pi) - math.pi)


def _is_at(point, place):
    is_near = math.hypot(point[0] - place["x"], point[1] - place["y"]) <= PLACE
    return is_near and _turned(point[2], place.get("theta", 0.0)) <= PLACE


def _ends(problem, spot_of, paths):
    violations = []
    for module, points in paths.items():
        if not _is_at(points[0], problem.modules[module]) or points[0][3] < 0:
            violations.append(f"module {module} does not begin where it stands: {points[0]}")
        spot = spot_of.get(module)
        if spot is not None and not _is_at(points[-1], problem.spots[spot]):
            violations.append(f"module {module} does not end on spot {spot}: {points[-1]}")
    return violations


def _speeds(problem, paths):
    violations = []
    for module, points in paths.items():
        for point, later in zip(points, points[1:]):
            way = math.hypot(later[0] - point[0], later[1] - point[1])
            if way > problem.speed * (later[3] - point[3]) + PLACE:
                violations.append(
                    f"module {module} goes {way:.3f} units in {later[3] - point[3]:g} from time {point[3]:g} on; at most "
                    f"{problem.speed:g} a unit of time"
                )
                break
    return violations


def _motion_measures(paths):
    arrivals = [points[-1][3] for points in paths.values()]
    ways = [
        math.hypot(later[0] - point[0], later[1] - point[1])
        for points in paths.values()
        for point, later in zip(points, points[1:])
    ]
    return {"makespan": max(arrivals, default=0.0), "flowtime": math.fsum(arrivals), "path_length": math.fsum(ways)}


# The model of cells.


def _cells(problem, paths):
    violations, cells = [], {}
    for module, points in paths.items():
        cells[module] = _cell_at_each_time(points)
        if cells[module] is None:
            violations.append(f"module {module} is not at a cell at each whole time, or moves by more than one cell")
    if violations:
        return violations
    end = max(map(len, cells.values()))
    at = {module: steps + [steps[-1]] * (end - len(steps)) for module, steps in cells.items()}
    closed = set()
    for low_x, low_y, high_x, high_y in problem.obstacles:
        closed |= {
            (x, y)
            for x in range(math.floor(low_x + 0.5 + TOUCH), math.ceil(high_x - 0.5 - TOUCH) + 1)
            for y in range(math.floor(low_y + 0.5 + TOUCH), math.ceil(high_y - 0.5 - TOUCH) + 1)
        }
    for time in range(end):
        holder, before = {}, {}
        for module, steps in at.items():
            cell = steps[time]
            if cell in closed:
                violations.append(f"module {module} is in an obstacle at {cell} at time {time}")
            if cell in holder:
                violations.append(f"modules {holder[cell]} and {module} are both at {cell} at time {time}")
            holder[cell] = module
            if time:
                before[steps[time - 1]] = module
        for cell, module in holder.items():
            other = before.get(cell)
            if time and other not in (None, module) and at[other][time] == at[module][time - 1] and module < other:
                violations.append(f"modules {module} and {other} change places at time {time}")
    return violations


def _cell_at_each_time(points):
    steps = []
    for point, later in zip(points, [*points[1:], None]):
        cell = (round(point[0]), round(point[1]))
        if max(abs(cell[0] - point[0]), abs(cell[1] - point[1])) > PLACE or abs(round(point[3]) - point[3]) > PLACE:
            return None
        until = round(point[3]) + 1 if later is None else round(later[3])
        if later is not None:
            way = abs(round(later[0]) - cell[0]) + abs(round(later[1]) - cell[1])
            if way > 1 or (way == 1 and until - round(point[3]) != 1):
                return None
        steps += [cell] * (until - len(steps))
    return steps


# The model of bodies.


def _docked(problem, result):
    """Until when each module stays docked to others with which it starts."""
    docked = defaultdict(dict)
    with _reading("result"):
        for number, (one, other, until) in enumerate(result.get("docked", ())):
            if frozenset((one, other)) not in problem.links:
                raise FormatError(f"result: docked[{number}]: modules {one} and {other} are not docked at the start")
            docked[one][other] = docked[other][one] = math.inf if until is None else float(until)
    return docked


def _are_one_body(docked, one, other, time):
    """Whether two modules are docked at a time, directly or through others."""
    reached, open_modules = {one}, [one]
    while open_modules:
        for near, until in docked.get(open_modules.pop(), {}).items():
            if until >= time and near not in reached:
                reached.add(near)
                open_modules.append(near)
    return other in reached


def _pose(point, later, time):
    if later is None or time <= point[3]:
        return point[:3]
    part = min(1.0, (time - point[3]) / (later[3] - point[3]))
    return tuple(from_ + part * (to - from_) for from_, to in zip(point[:3], later[:3]))


def _legs(points, low, high):
    """The parts of a path between two times: from, to, when it begins and ends."""
    if low < points[0][3]:
        yield points[0][:3], points[0][:3], low, min(high, points[0][3])
    for point, later in zip(points, points[1:]):
        begin, end = max(low, point[3]), min(high, later[3])
        if begin < end:
            yield _pose(point, later, begin), _pose(point, later, end), begin, end
    if high > points[-1][3]:
        yield points[-1][:3], points[-1][:3], max(low, points[-1][3]), high


def _windows(paths):
    """Moments that divide the time, about a unit apart or where there is more than one leg a unit."""
    end = max(points[-1][3] for points in paths.values())
    legs = max(len(points) for points in paths.values())
    count = max(1, math.ceil(end), min(legs, 4 * math.ceil(end)))
    return [end * number / count for number in range(count + 1)]


def _contacts(problem, paths, docked):
    violations, reported = [], set()
    moments = _windows(paths)
    # What a body reaches from its middle.
    reach = problem.width / 2 * (1 if problem.is_round else math.sqrt(2))
    for low, high in zip(moments, moments[1:] if len(moments) > 1 and moments[-1] > 0 else [0.0]):
        grid = defaultdict(list)
        legs, boxes, moves = {}, {}, {}
        for module, points in paths.items():
            own = list(_legs(points, low, high)) or [(points[0][:3], points[0][:3], low, high)]
            legs[module] = own
            ends = [end for leg in own for end in leg[:2]]
            moves[module] = any(leg[0] != leg[1] for leg in own)
            xs, ys = [end[0] for end in ends], [end[1] for end in ends]
            boxes[module] = (min(xs) - reach, min(ys) - reach, max(xs) + reach, max(ys) + reach)
            for x in range(math.floor(boxes[module][0] / 2), math.floor(boxes[module][2] / 2) + 1):
                for y in range(math.floor(boxes[module][1] / 2), math.floor(boxes[module][3] / 2) + 1):
                    grid[x, y].append(module)
        near = {
            (min(one, other), max(one, other))
            for group in grid.values()
            for number, one in enumerate(group)
            for other in group[number + 1 :]
            if low == 0.0 or moves[one] or moves[other]
        }
        for one, other in sorted(near - reported):
            if not _boxes_meet(boxes[one], boxes[other]):
                continue
            time = _first_contact(problem, legs[one], legs[other])
            if time is not None and not _are_one_body(docked, one, other, time):
                reported.add((one, other))
                violations.append(f"modules {one} and {other} overlap at time {time:.3f}")
    return violations


def _boxes_meet(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _first_contact(problem, one_legs, other_legs):
    for one_from, one_to, one_begin, one_end in one_legs:
        for other_from, other_to, other_begin, other_end in other_legs:
            begin, end = max(one_begin, other_begin), min(one_end, other_end)
            if begin > end or (begin == end and one_begin != one_end and other_begin != other_end):
                continue
            one = [_between(one_from, one_to, one_begin, one_end, time) for time in (begin, end)]
            other = [_between(other_from, other_to, other_begin, other_end, time) for time in (begin, end)]
            time = _first_overlap(problem, one, other, begin, end)
            if time is not None:
                return time
    return None


def _between(from_, to, begin, end, time):
    part = 0.0 if end <= begin else (time - begin) / (end - begin)
    return tuple(first + part * (last - first) for first, last in zip(from_, to))


def _is_square_on(theta):
    """Whether a heading is a multiple of a quarter turn, so that the square is along the axes."""
    return abs((theta + math.pi / 4) % (math.pi / 2) - math.pi / 4) < 1e-9


def _first_overlap(problem, one, other, begin, end):
    """When two bodies that move straight on first overlap."""
    away = [tuple(b - a for a, b in zip(one[at][:2], other[at][:2])) for at in (0, 1)]
    if problem.is_round:
        part = _first_within_circle(away, problem.width - TOUCH)
        return None if part is None else begin + part * (end - begin)
    headings = [pose[2] for pose in (*one, *other)]
    if all(map(_is_square_on, headings)) and one[0][2] == one[1][2] and other[0][2] == other[1][2]:
        part = _first_within_square(away, problem.width - TOUCH)
        return None if part is None else begin + part * (end - begin)
    reach = problem.width * math.sqrt(0.5)
    swept = sum(math.dist(pair[0][:2], pair[1][:2]) + reach * abs(pair[1][2] - pair[0][2]) for pair in (one, other))
    count = max(1, math.ceil(swept / STRIDE))
    for number in range(count + 1):
        part = number / count
        poses = [tuple(a + part * (b - a) for a, b in zip(*pair)) for pair in (one, other)]
        if _squares_overlap(poses[0], poses[1], problem.width):
            return begin + part * (end - begin)
    return None


def _first_within_circle(away, radius):
    """The first part of the way, from 0 to 1, at which a point that moves straight on is nearer to the origin than this."""
    (x, y), (to_x, to_y) = away
    dx, dy = to_x - x, to_y - y
    a, b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - radius * radius
    if c < 0:
        return 0.0
    root = b * b - a * c
    if a == 0 or root <= 0:
        return None
    part = (-b - math.sqrt(root)) / a
    return part if 0 <= part <= 1 else None


def _first_within_square(away, extent):
    """The same where both coordinates must be less than this."""
    low, high = 0.0, 1.0
    for axis in (0, 1):
        from_, by = away[0][axis], away[1][axis] - away[0][axis]
        if by == 0:
            if abs(from_) >= extent:
                return None
            continue
        ends = sorted(((-extent - from_) / by, (extent - from_) / by))
        low, high = max(low, ends[0]), min(high, ends[1])
    return low if low < high or (low == high and away[0] == away[1]) else None


def _corners(pose, width):
    cosine, sine, half = math.cos(pose[2]), math.sin(pose[2]), width / 2
    return [
        (pose[0] + half * (a * cosine - b * sine), pose[1] + half * (a * sine + b * cosine))
        for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    ]


def _squares_overlap(one, other, width):
    """By the axes that could separate them."""
    corners = [_corners(pose, width) for pose in (one, other)]
    for theta in (one[2], one[2] + math.pi / 2, other[2], other[2] + math.pi / 2):
        axis = (math.cos(theta), math.sin(theta))
        spans = [[x * axis[0] + y * axis[1] for x, y in body] for body in corners]
        if max(spans[0]) <= min(spans[1]) + TOUCH or max(spans[1]) <= min(spans[0]) + TOUCH:
            return False
    return True


def _walls(problem, paths):
    violations = []
    grid = defaultdict(list)
    for box in problem.obstacles:
        for x in range(math.floor(box[0] / 4), math.floor(box[2] / 4) + 1):
            for y in range(math.floor(box[1] / 4), math.floor(box[3] / 4) + 1):
                grid[x, y].append(box)
    for module, points in paths.items():
        wrong = None
        for point, later in zip(points, points[1:] or points):
            wrong = _first_wall(problem, grid, point, later)
            if wrong:
                violations.append(f"module {module} {wrong} between times {point[3]:g} and {later[3]:g}")
                break
    return violations


def _first_wall(problem, grid, point, later):
    is_round, half = problem.is_round, problem.width / 2
    is_along_an_axis = point[0] == later[0] or point[1] == later[1]
    if not is_round and point[2] == later[2] and _is_square_on(point[2]) and is_along_an_axis:
        # The square sweeps a box, and nothing beside it.
        low = [min(point[axis], later[axis]) - half for axis in (0, 1)]
        high = [max(point[axis], later[axis]) + half for axis in (0, 1)]
        return _wall_of_box(problem, grid, (*low, *high))
    turns = point[2] != later[2] or not _is_square_on(point[2])
    swept = math.dist(point[:2], later[:2]) + half * math.sqrt(2) * abs(later[2] - point[2])
    # Without obstacles and turns, a way is within the arena if its ends are.
    count = max(1, math.ceil(swept / STRIDE)) if (turns or is_round or grid) else 1
    for number in range(count + 1):
        pose = tuple(a + number / count * (b - a) for a, b in zip(point[:3], later[:3]))
        corners = _corners(pose, problem.width)
        reach = half if is_round else max(corner[0] for corner in corners) - pose[0]
        box = (pose[0] - reach, pose[1] - reach, pose[0] + reach, pose[1] + reach)
        arena = problem.arena
        if arena is not None and not _is_within(box, arena):
            return "leaves the arena"
        for x in range(math.floor(box[0] / 4), math.floor(box[2] / 4) + 1):
            for y in range(math.floor(box[1] / 4), math.floor(box[3] / 4) + 1):
                if any(_meets_box(pose, corners, wall, problem) for wall in grid.get((x, y), ())):
                    return "is in an obstacle"
    return None


def _wall_of_box(problem, grid, box):
    arena = problem.arena
    if arena is not None and not _is_within(box, arena):
        return "leaves the arena"
    for x in range(math.floor(box[0] / 4), math.floor(box[2] / 4) + 1):
        for y in range(math.floor(box[1] / 4), math.floor(box[3] / 4) + 1):
            for wall in grid.get((x, y), ()):
                if _boxes_meet(box, (wall[0] + TOUCH, wall[1] + TOUCH, wall[2] - TOUCH, wall[3] - TOUCH)):
                    return "is in an obstacle"
    return None


def _is_within(box, arena):
    low = box[0] >= arena[0] - TOUCH and box[1] >= arena[1] - TOUCH
    return low and box[2] <= arena[2] + TOUCH and box[3] <= arena[3] + TOUCH


def _meets_box(pose, corners, wall, problem):
    if problem.is_round:
        near = (min(max(pose[0], wall[0]), wall[2]), min(max(pose[1], wall[1]), wall[3]))
        return math.dist(near, pose[:2]) < problem.width / 2 - TOUCH
    ends = [(wall[0], wall[1]), (wall[2], wall[1]), (wall[2], wall[3]), (wall[0], wall[3])]
    for theta in (0.0, math.pi / 2, pose[2], pose[2] + math.pi / 2):
        axis = (math.cos(theta), math.sin(theta))
        spans = [[x * axis[0] + y * axis[1] for x, y in body] for body in (corners, ends)]
        if max(spans[0]) <= min(spans[1]) + TOUCH or max(spans[1]) <= min(spans[0]) + TOUCH:
            return False
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("instance")
    parser.add_argument("result")
    parser.add_argument("--model", choices=MODELS, default="bodies")
    arguments = parser.parse_args()
    try:
        with open(arguments.instance, encoding="utf-8") as instance, open(arguments.result, encoding="utf-8") as result:
            verdict = judge(json.load(instance), json.load(result), arguments.model)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    print(json.dumps(verdict, indent=1))
    sys.exit(0 if verdict["valid"] else 1)


if __name__ == "__main__":
    main()
