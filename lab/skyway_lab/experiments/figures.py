"""The figures, drawn by matplotlib without a screen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skyway.errors import SkywayError
from skyway_lab.experiments.sample import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours that people with colour blindness can distinguish (Okabe and Ito 2008).
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_MARKERS = "osD^vP*"
_SIZE_IN = (6.4, 4.2)

#: What the legend adds to the name of a line for its open markers.
_LIMITED = ": limit reached"

#: Length of the arrow at a value that is only a lower limit, points.
_ARROW_PT = 16

#: The share of the axis that a group of bars takes, 0 to 1.
_GROUP_WIDTH = 0.8

_LEGEND_COLUMNS = 3


class NoMatplotlib(SkywayError):
    """The figures need matplotlib, which is not installed."""

    def __init__(self) -> None:
        super().__init__("the figures need matplotlib: pip install matplotlib")


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a figure: estimates over x.

    A marker is open where the time limit ended some runs: `is_limited` says so for each estimate.
    An estimate that is only a lower limit has an open marker with an arrow.
    """

    label: str
    xs: Sequence[float]
    estimates: Sequence[Estimate]
    is_limited: Sequence[bool] = ()


@dataclass(frozen=True, slots=True)
class Axis:
    """The label of an axis, and its scale."""

    label: str
    scale: str = "linear"


@dataclass(frozen=True, slots=True)
class Stack:
    """One part of every bar of a figure of stacked bars, or one bar of every group."""

    label: str
    heights: Sequence[float] = field(default_factory=tuple)


def require_matplotlib() -> None:
    """Choose the backend that needs no screen.

    Raises
    ------
    NoMatplotlib
        It is not installed.
    """
    try:
        import matplotlib as mpl
    except ImportError as error:
        raise NoMatplotlib from error
    mpl.use("Agg")


def draw_lines(path: Path, title: str, *, x: Axis, y: Axis, lines: Sequence[Line]) -> None:
    """A figure of lines with their 95 % intervals as bands."""
    figure, axes = _figure(title)
    for number, line in enumerate(lines):
        _draw_line(axes, line, number)
    if any(math.isfinite(each.value) for line in lines for each in line.estimates):
        axes.set_xscale(x.scale)
        axes.set_yscale(y.scale)
    axes.set_xlabel(x.label)
    axes.set_ylabel(y.label)
    axes.grid(visible=True, which="major", alpha=0.3)
    axes.legend()
    _save(figure, path)


def draw_stacks(
    path: Path, title: str, *, x: Axis, y: Axis, bars: Sequence[str], stacks: Sequence[Stack]
) -> None:
    """A figure of stacked bars; heights below 0 are stacked downwards."""
    figure, axes = _figure(title)
    up, down = [0.0] * len(bars), [0.0] * len(bars)
    for stack, colour in zip(stacks, _COLOURS, strict=False):
        bottoms = [
            up[bar] if height >= 0 else down[bar] for bar, height in enumerate(stack.heights)
        ]
        axes.bar(bars, stack.heights, bottom=bottoms, label=stack.label, color=colour)
        for bar, height in enumerate(stack.heights):
            if height >= 0:
                up[bar] += height
            else:
                down[bar] += height
    axes.set_xlabel(x.label)
    axes.set_ylabel(y.label)
    figure.legend(loc="outside lower center", ncols=_LEGEND_COLUMNS)
    _save(figure, path)


def draw_groups(
    path: Path, title: str, *, x: Axis, y: Axis, groups: Sequence[str], bars: Sequence[Stack]
) -> None:
    """A figure of groups of bars: in each group one bar of each label, side by side."""
    figure, axes = _figure(title)
    width = _GROUP_WIDTH / len(bars)
    for number, (bar, colour) in enumerate(zip(bars, _COLOURS, strict=False)):
        middle = (number + 0.5) * width - _GROUP_WIDTH / 2
        at = [group + middle for group in range(len(groups))]
        axes.bar(at, bar.heights, width, label=bar.label, color=colour)
    axes.set_xticks(range(len(groups)), groups)
    axes.set_xlabel(x.label)
    axes.set_ylabel(y.label)
    axes.grid(visible=True, axis="y", alpha=0.3)
    figure.legend(loc="outside lower center", ncols=_LEGEND_COLUMNS)
    _save(figure, path)


def _figure(title: str) -> tuple[Any, "Axes"]:  # matplotlib's Figure, imported late
    require_matplotlib()
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=_SIZE_IN, layout="constrained")
    axes.set_title(title, fontsize=11)
    return figure, axes


def _draw_line(axes: "Axes", line: Line, number: int) -> None:
    colour = _COLOURS[number % len(_COLOURS)]
    marker = _MARKERS[number % len(_MARKERS)]
    is_limited = line.is_limited or [False] * len(line.xs)
    shown = [
        (x, estimate, is_open or estimate.is_at_least)
        for x, estimate, is_open in zip(line.xs, line.estimates, is_limited, strict=True)
        if math.isfinite(estimate.value)
    ]
    xs = [x for x, _, _ in shown]
    values = [estimate.value for _, estimate, _ in shown]
    axes.plot(xs, values, color=colour, label=None if shown else line.label)
    highs = [max(e.value, e.high if math.isfinite(e.high) else e.value) for _, e, _ in shown]
    lows = [estimate.low for _, estimate, _ in shown]
    axes.fill_between(xs, lows, highs, color=colour, alpha=0.15, linewidth=0)
    for is_open, size, face, suffix in ((False, 4, colour, ""), (True, 6, "white", _LIMITED)):
        marked = [(x, estimate.value) for x, estimate, opened in shown if opened is is_open]
        axes.plot(
            [x for x, _ in marked],
            [value for _, value in marked],
            color=colour,
            linestyle="",
            marker=marker,
            markersize=size,
            markerfacecolor=face,
            label=f"{line.label}{suffix}" if marked else None,
        )
    for x, estimate, _ in shown:
        if estimate.is_at_least:
            _draw_arrow(axes, x, estimate.value, colour)


def _draw_arrow(axes: "Axes", x: float, y: float, colour: str) -> None:
    """An arrow up from this point: the true value lies here or above."""
    axes.annotate(
        "",
        xy=(x, y),
        xytext=(0, _ARROW_PT),
        textcoords="offset points",
        arrowprops={"arrowstyle": "<-", "color": colour},
    )


def _save(figure: Any, path: Path) -> None:  # matplotlib's Figure, imported late
    from matplotlib import pyplot

    # No date and no version inside: the same results make the same file.
    hidden = {"Date": None, "Creator": None} if path.suffix == ".svg" else {"Software": None}
    figure.savefig(path, dpi=110, metadata=hidden)
    pyplot.close(figure)
