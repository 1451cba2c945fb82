"""Instances of labelled robots on cells, from a seed, of the kinds that the CG:SHOP Challenge 2021 has.

The contest draws starts and targets uniformly or in clusters, on an open grid or between obstacles, and dissolves pictures into
others. These are drawn by the same words, not by its programs.
"""

from __future__ import annotations

import random

__all__ = ["KINDS", "draw"]


def uniform(chance, cells, count):
    return chance.sample(cells, count)


def clustered(chance, cells, count):
    """Cells near some middles, each more likely the nearer it is."""
    middles = [chance.choice(cells) for _ in range(max(2, count // 25))]

    def rank(cell):
        nearest = min((cell[0] - x) ** 2 + (cell[1] - y) ** 2 for x, y in middles)
        return nearest * chance.uniform(0.5, 1.5)

    return chance.sample(sorted(cells, key=rank)[:count], count)


def microbes(chance, cells, count):
    """Rings around some middles."""
    middles = [(chance.choice(cells), chance.uniform(1, 4)) for _ in range(max(2, count // 20))]

    def rank(cell):
        return min(abs(((cell[0] - x) ** 2 + (cell[1] - y) ** 2) ** 0.5 - radius) for (x, y), radius in middles)

    return chance.sample(sorted(cells, key=rank)[:count], count)


#: How starts are drawn, how targets are, and the share of the field that obstacles take.
KINDS = {
    "uniform": (uniform, uniform, 0.0),
    "uniform_walled": (uniform, uniform, 0.2),
    "clusters": (clustered, clustered, 0.0),
    "clusters_walled": (clustered, uniform, 0.15),
    "microbes": (microbes, microbes, 0.1),
}


def draw(kind, width, share, seed):
    """An instance with robots on this share of the cells that are free, at most all of them.

    Obstacles leave all robots a way: cells that they enclose are filled up.
    """
    starts_of, targets_of, walls = KINDS[kind]
    chance = random.Random(f"{kind} {width} {share} {seed}")
    field = [(x, y) for x in range(width) for y in range(width)]
    obstacles = set(chance.sample(field, int(walls * len(field))))
    inside = connected_to_outside(width, obstacles)
    obstacles |= set(field) - inside
    cells = sorted(inside)
    count = max(1, int(share * len(cells)))
    starts, targets = starts_of(chance, cells, count), targets_of(chance, cells, count)
    return {
        "name": f"{kind}_{width}x{width}_{round(100 * share)}_{count}",
        "meta": {"number_of_robots": count},
        "starts": [list(cell) for cell in starts],
        "targets": [list(cell) for cell in targets],
        "obstacles": [list(cell) for cell in sorted(obstacles)],
    }


def connected_to_outside(width, obstacles):
    """The cells of the field from which a way leads out of it."""
    open_cells, reached = [(-1, -1)], {(-1, -1)}
    while open_cells:
        x, y = open_cells.pop()
        for cell in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if all(-1 <= along <= width for along in cell) and cell not in reached and cell not in obstacles:
                reached.add(cell)
                open_cells.append(cell)
    return {cell for cell in reached if all(0 <= along < width for along in cell)}
