#!/usr/bin/env python3
"""Draws the plots of `formation experiments` from the CSV files that it writes into OUT.

    python3 -m venv .venv && .venv/bin/pip install -r experiments/plot_requirements.txt
    .venv/bin/python experiments/plot.py OUT [--to DIR] [--format svg]

Each figure whose CSV file is in OUT becomes one file; the script prints its path. SVG files carry two sets of colours,
for light and for dark surroundings, and choose by the viewer's colour scheme.
"""

import argparse
import csv
import io
import math
import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path

try:
    import matplotlib
except ImportError:
    sys.exit("error: matplotlib is missing; run `pip install -r experiments/plot_requirements.txt`")

matplotlib.use("Agg")
from matplotlib import colormaps, pyplot
from matplotlib.colors import to_hex
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import offset_copy

# Light and dark variants, each with a contrast of at least 3 to 1 on its paper. The hues are those of M. Okabe and K. Ito,
# "Color Universal Design"; markers repeat what colours say.
PAPER = ("#ffffff", "#14171b")
INK = ("#16191d", "#eef1f4")
GRID = ("#e3e6ea", "#2a3037")
VERMILION = ("#d55e00", "#ff8b3d")
BLUE = ("#00629c", "#5aaef0")
SKY = ("#2e90c8", "#a8dcfb")
ORANGE = ("#ae7700", "#f0b429")
GREEN = ("#00875f", "#35cf9f")
PURPLE = ("#b0508a", "#e79fca")
COLOURS = [PAPER, INK, GRID, VERMILION, BLUE, SKY, ORANGE, GREEN, PURPLE]
# The part of the map "plasma" that has this contrast, by the number of a step: on light and on dark paper.
RAMPS = ((0.0, 0.6), (0.42, 1.0))
STEP_MARKERS = ["o", "s", "^", "D", "v", "X"]

# Widths and heights of a panel in inches: alone, and one of several.
ONE_PANEL = (6.4, 3.8)
ONE_OF_PANELS = (4.4, 3.3)
DASHED, DOTTED = (0, (4, 2)), (0, (1, 2))


@dataclass(frozen=True)
class Look:
    """How a series is drawn. `line` is "none" for points alone; `every` is the distance of markers, from the last point."""

    label: str
    colour: tuple
    marker: str = "o"
    line: object = "-"
    hollow: bool = False
    every: int = 1
    width: float = 1.8
    opacity: float = 1.0


PAPER_POLICY = Look("paper policy", VERMILION, "s")
OURS = Look("ours", BLUE, "o")
AUCTION = Look("auction", ORANGE, "X", DASHED)
LOOKS = {
    "paper_policy": PAPER_POLICY,
    "paper_policy_charitable": replace(PAPER_POLICY, label="paper policy, charitable", line=DASHED, hollow=True),
    "ours": OURS,
    "ours_size_first": Look("ours, size first", SKY, "^"),
    "auction": AUCTION,
    "hungarian": Look("Hungarian", GREEN, "o", DOTTED, hollow=True),
}
STATED = Look("paper, stated in its text", INK, "D", "none")


def number(text):
    try:
        return float(text)
    except ValueError:
        return text


class Results:
    """The CSV files of a directory, each as a list of rows."""

    def __init__(self, directory):
        self.directory = directory
        self.tables = {}

    def has(self, name):
        return (self.directory / f"{name}.csv").is_file()

    def rows(self, name, **wanted):
        """The rows of a table that have these values."""
        if name not in self.tables:
            with open(self.directory / f"{name}.csv", newline="", encoding="utf-8") as file:
                self.tables[name] = [{key: number(text) for key, text in row.items()} for row in csv.DictReader(file)]
        return [row for row in self.tables[name] if all(row[key] == value for key, value in wanted.items())]

    def values(self, name, column):
        """The values of a column, each once, in the order of the rows."""
        return list(dict.fromkeys(row[column] for row in self.rows(name)))

    def stated(self, name, column, quantity, of=None):
        """The paper's numbers for a quantity of this figure (or of another), at the column's values in the figure."""
        known = self.values(name, column)
        return [row for row in self.rows("paper", experiment=of or name, quantity=quantity) if row["at"] in known]


class Figure:
    """A picture of one or more panels, two in a row."""

    def __init__(self, title, panels=1):
        columns = min(panels, 2)
        rows = math.ceil(panels / columns)
        width, height = ONE_PANEL if panels == 1 else ONE_OF_PANELS
        self.figure, axes = pyplot.subplots(
            rows, columns, figsize=(columns * width, rows * height + 0.5), squeeze=False, layout="constrained"
        )
        self.figure.suptitle(title, fontsize=12)
        self.panels = [Panel(self.figure, one) for one in axes.flat]

    def finish(self):
        """Places the legend: below all panels if they share it, else below each."""
        legends = [panel.legend() for panel in self.panels]
        if all(legend == legends[0] for legend in legends):
            handles = self.panels[0].axes.get_legend_handles_labels()[0]
            columns = legend_columns(legends[0], self.figure.get_figwidth())
            legend = self.figure.legend(handles, legends[0], loc="outside lower center", ncols=columns)
            for handle in legend.legend_handles:
                handle.set_alpha(1)
        else:
            for panel in self.panels:
                columns = legend_columns(panel.legend(), ONE_OF_PANELS[0])
                panel.axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=columns)
        return self.figure


def legend_columns(labels, width):
    """How many columns of labels fit into this many inches."""
    widest = 0.55 + 0.072 * max(len(label) for label in labels)
    return max(1, min(len(labels), int(width / widest)))


class Panel:
    """One coordinate system."""

    def __init__(self, figure, axes):
        self.figure = figure
        self.axes = axes
        self.bars = 0
        self.lowest, self.highest = math.inf, -math.inf

    def legend(self):
        return self.axes.get_legend_handles_labels()[1]

    def axis(self, which, label, kind):
        """Labels an axis, and sets its range: "zero" begins at 0, "percent" is 0 to 100, "log" is whole decades."""
        getattr(self.axes, f"set_{which}label")(label)
        axis, limit = getattr(self.axes, f"{which}axis"), getattr(self.axes, f"set_{which}lim")
        if kind == "log":
            getattr(self.axes, f"set_{which}scale")("log")
            limit(10 ** math.floor(math.log10(self.lowest)), 10 ** math.ceil(math.log10(self.highest * 1.02)))
            axis.set_major_locator(LogLocator(numticks=20))
            axis.set_minor_formatter(NullFormatter())
        elif kind == "percent":
            limit(0, 100)
        elif kind == "zero":
            limit(0, self.highest * 1.04 if which == "y" else None)
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))

    def draw(self, look, points):
        """Draws a series of (x, y) or (x, y, standard deviation)."""
        if not points:
            return
        xs, ys = [point[0] for point in points], [point[1] for point in points]
        deviations = [point[2] if len(point) > 2 and point[2] != "" else 0 for point in points]
        self.lowest = min(self.lowest, *ys)
        self.highest = max(self.highest, *(y + deviation for y, deviation in zip(ys, deviations)))
        colour = look.colour[0]
        [line] = self.axes.plot(
            xs, ys, label=look.label or None, color=colour, marker=look.marker, linestyle=look.line,
            linewidth=look.width, alpha=look.opacity, markersize=8 if look.hollow else 5.5, clip_on=False, zorder=3,
            markeredgecolor=colour, markerfacecolor="none" if look.hollow else colour,
            markevery=list(range(len(points) - 1, -1, -look.every)),
        )
        # Matplotlib omits points on straight parts of a line by itself only if the line has many points.
        line.get_path().should_simplify = True
        if any(deviations):
            # Bars of several series are drawn side by side, because they would hide each other.
            aside = (self.bars + 1) // 2 * (1.5 if self.bars % 2 else -1.5)
            self.bars += 1
            self.axes.errorbar(
                xs, ys, deviations, linestyle="none", ecolor=colour, elinewidth=1, alpha=0.6, zorder=2,
                transform=offset_copy(self.axes.transData, self.figure, x=aside, units="points"),
            )


def points(rows, x, y, deviation=None):
    return [(row[x], row[y], row[deviation] if deviation else 0) for row in rows]


def mean_points(rows, x, name):
    return points(rows, x, f"{name}_mean", f"{name}_std")


def compared(results, name, title, x_label, quantity, y_label, y_kind="log"):
    """One quantity of every contender against the number of modules."""
    figure = Figure(title)
    [panel] = figure.panels
    for contender in results.values(name, "contender"):
        panel.draw(LOOKS[contender], mean_points(results.rows(name, contender=contender), "modules", quantity))
    panel.axis("x", x_label, "zero")
    panel.axis("y", y_label, y_kind)
    return figure


MODULES, SINGLETONS = "modules (as many spots)", "singletons (as many spots)"
TIME, DISTANCE = "planning time (ms)", "sum of all distances (units)"


def matching_time(results, name):
    rows = results.rows(name)
    figure = Figure(f"Finding a configuration's place among {rows[0]['spots']:.0f} spots")
    [panel] = figure.panels
    for look, label in [
        (PAPER_POLICY, "paper policy: first 20 common subtrees"),
        (OURS, "ours: the common subtree of greatest utility"),
    ]:
        quantity = f"{look.label.replace(' ', '_')}_ms"
        panel.draw(replace(look, label=label), mean_points(rows, "configuration_size", quantity))
    panel.axis("x", "modules of the configuration", "zero")
    panel.axis("y", "time (ms)", "log")
    return figure


def planning_time(results, name):
    return compared(results, name, "Planning time of the core, mixed instances", MODULES, "planning_ms", TIME)


def distance(results, name):
    return compared(results, name, "Distance travelled, mixed instances", MODULES, "distance_units", DISTANCE, "zero")


def distance_50_spots(results, name):
    title = "Distance travelled with 50 spots, mixed instances"
    return compared(results, name, title, "modules", "distance_units", DISTANCE, "zero")


def auction_time(results, name):
    return compared(results, name, "Planning time of singletons", SINGLETONS, "planning_ms", TIME)


def auction_distance(results, name):
    return compared(results, name, "Distance travelled by singletons", SINGLETONS, "distance_units", DISTANCE, "zero")


def auction_messages(results, name):
    title = "Messages of singletons while planning"
    return compared(results, name, title, SINGLETONS, "deliveries", "messages times receivers")


def messages(results, name):
    figure = Figure("Messages while planning, mixed instances")
    [panel] = figure.panels
    panel.draw(STATED, points(results.stated(name, "modules", "pairs_delivered"), "at", "value"))
    for look, contender, quantity, label in [
        (replace(PAPER_POLICY, line=DASHED, hollow=True), "paper_policy", "whole_sets_pairs",
            "paper policy, whole sets: pairs"),
        (PAPER_POLICY, "paper_policy", "pairs_delivered", "paper policy, our claims: pairs"),
        (OURS, "ours", "pairs_delivered", "ours, claims: pairs"),
        (LOOKS["ours_size_first"], "ours", "deliveries", "ours, claims and notices: deliveries"),
    ]:
        panel.draw(replace(look, label=label), mean_points(results.rows(name, contender=contender), "modules", quantity))
    panel.axis("x", MODULES, "zero")
    panel.axis("y", "pairs, or samples, times receivers", "log")
    return figure


def messages_50_spots(results, name):
    few = min(results.values(name, "spots"))
    figure = Figure(f"Messages with {few:.0f} spots and with a spot for each module")
    [panel] = figure.panels
    rows = results.rows(name)
    for spots, chosen in [
        (f"{few:.0f} spots", [row for row in rows if row["spots"] == few]),
        ("a spot for each", [row for row in rows if row["spots"] == row["modules"]]),
    ]:
        for look, contender, quantity in [
            (replace(PAPER_POLICY, label="paper policy, whole sets"), "paper_policy", "whole_sets_pairs"),
            (OURS, "ours", "pairs_delivered"),
        ]:
            look = replace(look, label=f"{look.label}, {spots}")
            if spots == "a spot for each":
                look = replace(look, line=DASHED, hollow=True)
            of_contender = [row for row in chosen if row["contender"] == contender]
            panel.draw(look, mean_points(of_contender, "modules", quantity))
    stated = results.stated(name, "modules", "pairs_delivered")
    stated += results.stated(name, "modules", "pairs_delivered", of="messages")
    panel.draw(replace(STATED, label="paper, stated in its text: 50 and 100 spots"), points(stated, "at", "value"))
    panel.axis("x", "modules", "data")
    panel.axis("y", "pairs delivered", "log")
    return figure


def step_look(label, position, count):
    """The look of one of several ordered series, from the first to the last colour of the ramp."""
    place = position / max(count - 1, 1)
    plasma = colormaps["plasma"]
    colour = tuple(to_hex(plasma(low + (high - low) * place)) for low, high in RAMPS)
    COLOURS.append(colour)
    return Look(label, colour, STEP_MARKERS[position % len(STEP_MARKERS)], every=4, hollow=position % 2 == 1)


def completion(results, name):
    sizes = results.values(name, "modules")
    of_spots = "a spot for each module" if name == "completion" else f"{min(sizes):.0f} spots"
    figure = Figure(f"Spots selected against time, {of_spots}", 4)
    panels = iter(figure.panels)
    stated = results.stated(name, "modules", "selected_percent")
    for contender in ["ours", "paper_policy"]:
        for where, table, quantity, label in [
            ("in the protocol", name, "selected_percent_mean", "simulated planning time elapsed (%)"),
            ("in the core", f"{name}_times", "selected_percent_by_computing_time_mean", "computing time elapsed (%)"),
        ]:
            panel = next(panels)
            panel.axes.set_title(f"{LOOKS[contender].label}, {where}")
            for position, size in enumerate(sizes):
                rows = results.rows(table, contender=contender, modules=size)
                panel.draw(step_look(f"{size:.0f} modules", position, len(sizes)), points(rows, "time_percent", quantity))
            for row, marker in zip(stated, ["D", "X"]):
                look = replace(STATED, label=f"paper: {row['at']:.0f} modules", marker=marker)
                panel.draw(look, [(row["time_percent"], row["value"])])
            panel.axis("x", label, "percent")
            panel.axis("y", "spots selected (%)", "percent")
    return figure


def messages_over_time(results, name):
    figure = Figure("Messages while 100 modules plan, mixed instances", 2)
    for panel, x, label, kind in zip(
        figure.panels,
        ["time_ms", "completion_percent"],
        ["simulated time since the roster (ms)", "spots selected (%)"],
        ["zero", "percent"],
    ):
        for contender in results.values(name, "contender"):
            look = LOOKS[contender]
            legend = f"{look.label}: a line a run, marked at its end"
            for seed in results.values(name, "seed"):
                rows = results.rows(name, contender=contender, seed=seed)
                look = replace(look, label=legend, every=len(rows), width=0.8, opacity=0.5)
                panel.draw(look, points(rows, x, "pairs_delivered"))
                legend = ""
        panel.axis("x", label, kind)
        panel.axis("y", "pairs delivered so far", "zero")
    return figure


def auction_completion(results, name):
    figure = Figure("Planning completion of 100 singletons", 2)
    for panel, title, quantity in zip(
        figure.panels,
        ["modules that hold a spot", "modules that hold their final spot"],
        ["holding_percent", "settled_percent"],
    ):
        panel.axes.set_title(title)
        for contender in results.values(name, "contender"):
            rows = results.rows(name, contender=contender)
            panel.draw(replace(LOOKS[contender], every=2), mean_points(rows, "time_percent", quantity))
        panel.axis("x", "planning time elapsed (%)", "percent")
        panel.axis("y", "modules (%)", "percent")
    return figure


def disconnected(results, name):
    trees = results.values(name, "trees")
    figure = Figure("100 modules in configurations of one size", 2 * len(trees))
    panels = iter(figure.panels)
    counts = [
        ("unmatched_on_empty_target", Look("unmatched", PURPLE, "X")),
        ("broken_links", Look("broken links", BLUE, "o")),
        ("outside_largest_piece", Look("outside largest", GREEN, "^")),
        ("alone", Look("left alone", ORANGE, "o", hollow=True)),
    ]
    table = replace(STATED, label="paper, Table I")
    for kind in trees:
        panel = next(panels)
        panel.axes.set_title(f"planning time, {kind}")
        panel.draw(table, points(results.stated(name, "size", "planning_ms"), "at", "value", "std"))
        for contender in results.values(name, "contender"):
            rows = results.rows(f"{name}_times", trees=kind, contender=contender)
            panel.draw(LOOKS[contender], mean_points(rows, "size", "planning_ms"))
        panel.axis("y", TIME, "log")
        other = next(panels)
        other.axes.set_title(f"disconnected, {kind}")
        other.draw(table, points(results.stated(name, "size", "disconnected"), "at", "value", "std"))
        for quantity, look in counts:
            other.draw(look, mean_points(results.rows(name, trees=kind, contender="ours"), "size", quantity))
        broken = replace(PAPER_POLICY, label="paper policy, broken", line=DASHED)
        other.draw(broken, mean_points(results.rows(name, trees=kind, contender="paper_policy"), "size", "broken_links"))
        other.axis("y", "modules, or links", "zero")
        for one in (panel, other):
            one.axis("x", "size of all configurations (modules)", "zero")
    return figure


def case_studies(results, name):
    figure = Figure("Eight case studies", 2)
    # Markers of one case are drawn side by side, because equal values would hide each other.
    step = 0.2
    for panel, title, quantity, stated, label, kind, what in zip(
        figure.panels,
        ["planning time", "what is taken apart"],
        ["planning_ms", "broken_links"],
        ["planning_ms", "disconnections"],
        [TIME, "broken links, or port changes"],
        ["log", "zero"],
        ["", ": broken links"],
    ):
        panel.axes.set_title(title)
        series = [(replace(STATED, label="paper's own cases"), results.stated(name, "case", stated), "at", "value", -1.5)]
        for contender, aside in [("paper_policy", -0.5), ("ours", 0.5)]:
            look = replace(LOOKS[contender], label=LOOKS[contender].label + what, line="none")
            table = f"{name}_times" if quantity == "planning_ms" else name
            series.append((look, results.rows(table, contender=contender), "case", quantity, aside))
        if quantity == "broken_links":
            look = Look("ours: port changes", SKY, "^", "none")
            series.append((look, results.rows(name, contender="ours"), "case", "port_changes", 1.5))
        for look, rows, x, y, aside in series:
            panel.draw(look, [(row[x] + step * aside, row[y]) for row in rows])
        panel.axis("x", "case", "data")
        panel.axes.set_xticks(results.values(name, "case"))
        panel.axis("y", label, kind)
    return figure


def processes(results, name):
    figure = Figure("Planning time of real processes over DDS, mixed instances")
    [panel] = figure.panels
    rows, runs = results.rows(name), results.rows("processes_runs")
    places = {(row["modules"], row["processes"]): place for place, row in enumerate(rows)}
    each = [(places[run["modules"], run["processes"]] + 0.12, run["planning_ms"]) for run in runs]
    for look, series in [
        (Look("ours over DDS, median", BLUE, "o", "none"), [(n, row["planning_ms_median"]) for n, row in enumerate(rows)]),
        (Look("ours over DDS, each run", BLUE, "x", "none", opacity=0.6), each),
        (Look("ours, core alone, median", SKY, "^", "none"), [(n, row["core_ms_median"]) for n, row in enumerate(rows)]),
    ]:
        panel.draw(look, series)
    panel.axis("x", "modules on processes", "data")
    panel.axes.set_xlim(-0.5, len(rows) - 0.5)
    panel.axes.set_xticks(range(len(rows)), [f"{row['modules']:.0f} on {row['processes']:.0f}" for row in rows])
    panel.axis("y", TIME, "log")
    return figure


def cut_price(results, name):
    figure = Figure("The effect of the cut price, 100 modules", 2)
    kinds = results.values(name, "instances")
    prices = [f"{price:g}" for price in results.values(name, "cut_price")]
    for panel, quantity, label in zip(
        figure.panels, ["broken_links", "distance_units"], ["broken links", DISTANCE]
    ):
        for position, kind in enumerate(kinds):
            rows = results.rows(name, instances=kind)
            look = replace(step_look(kind, position, len(kinds)), every=1)
            panel.draw(look, [(place, row[f"{quantity}_mean"]) for place, row in enumerate(rows)])
        panel.axis("x", "price of a cut (units)", "data")
        panel.axes.set_xticks(range(len(prices)), prices)
        panel.axis("y", label, "zero")
    return figure


def physical_world(results, name):
    figure = Figure("Formations in a physical world", 2)
    for panel, varied, label, fixed in zip(
        figure.panels, ["slip", "noise"], ["slip, at a noise of 0.01", "noise (units), at a slip of 0.2"],
        [("noise", 0.01), ("slip", 0.2)],
    ):
        for scenario, look in zip(results.values(name, "scenario"), [OURS, replace(AUCTION, line="-")]):
            rows = results.rows(name, scenario=scenario, **dict([fixed]))
            rows = sorted((row for row in rows if row["complete_mean"] > 0), key=lambda row: row[varied])
            panel.draw(replace(look, label=scenario), points(rows, varied, "acting_s_median"))
        panel.axis("x", label, "data")
        panel.axis("y", "acting, median (s)", "zero")
    return figure


FIGURES = {
    "matching_time": matching_time,
    "planning_time": planning_time,
    "distance": distance,
    "distance_50_spots": distance_50_spots,
    "messages": messages,
    "completion": completion,
    "messages_over_time": messages_over_time,
    "completion_50_spots": completion,
    "messages_50_spots": messages_50_spots,
    "disconnected": disconnected,
    "auction_time": auction_time,
    "auction_distance": auction_distance,
    "auction_messages": auction_messages,
    "auction_completion": auction_completion,
    "case_studies": case_studies,
    "cut_price": cut_price,
    "processes": processes,
    "physical_world": physical_world,
}


def with_dark_colours(svg):
    """Adds the dark variant of every colour, for viewers whose colour scheme is dark; shortens coordinates."""
    rules = []
    for light, dark in COLOURS:
        for paint in ("fill", "stroke"):
            rules.append(f'[style*="{paint}: {light}"] {{ {paint}: {dark} !important; }}')
    style = "<style>@media (prefers-color-scheme: dark) {{\n{}\n}}</style>".format("\n".join(dict.fromkeys(rules)))
    svg = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d)\d+", r"\1", path.group()).replace(" \n", ""), svg)
    # Attributes alone: a number that people read keeps its digits.
    svg = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\.\d\d)\d+", r"\1", tag.group()), svg)
    return svg.replace("</defs>", f"</defs>\n{style}", 1)


def write(figure, path):
    # Without a date and with fixed names, equal results give equal files.
    if path.suffix != ".svg":
        figure.savefig(path)
        return
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    path.write_text(with_dark_colours(text.getvalue()), encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", metavar="OUT", type=Path, help="the directory that `formation experiments` wrote")
    parser.add_argument("--to", metavar="DIR", type=Path, help="where to write the plots; default: OUT")
    parser.add_argument("--format", choices=["svg", "png", "pdf"], default="svg")
    arguments = parser.parse_args()
    results = Results(arguments.directory)
    known = [name for name in FIGURES if results.has(name)]
    if not known:
        parser.error(f"{arguments.directory} holds no CSV file of `formation experiments`")
    matplotlib.rcParams.update({
        "svg.fonttype": "none", "svg.hashsalt": "formation", "font.family": "sans-serif", "font.size": 10,
        "font.sans-serif": ["DejaVu Sans"], "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
        "axes.axisbelow": True, "axes.titlesize": 11, "legend.frameon": False, "legend.fontsize": 9,
        "grid.color": GRID[0], "figure.facecolor": PAPER[0], "axes.facecolor": PAPER[0], "text.color": INK[0],
        "axes.edgecolor": INK[0], "axes.labelcolor": INK[0], "axes.titlecolor": INK[0],
        "xtick.color": INK[0], "ytick.color": INK[0],
    })
    for name in known:
        figure = FIGURES[name](results, name).finish()
        path = (arguments.to or arguments.directory) / f"{name}.{arguments.format}"
        write(figure, path)
        pyplot.close(figure)
        print(path)


if __name__ == "__main__":
    main()
