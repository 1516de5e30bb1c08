"""The figure: what was offered and done, and how long the accepted requests waited."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot


def draw(findings: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Draw one column for each run; values are those of the JSON file of the run."""
    figure, axes = pyplot.subplots(
        2, len(findings), figsize=(3.4 * len(findings) + 1.6, 5.2), squeeze=False, sharex="col"
    )
    for column, (name, found) in enumerate(findings.items()):
        stages: Sequence[Mapping[str, Any]] = found["stages"]
        ticks = range(len(stages))
        rates, waits = axes[0][column], axes[1][column]
        for key, label, style in (
            ("offered_per_s", "offered", "k:"),
            ("accepted_per_s", "accepted", "C0s--"),
            ("done_per_s", "done", "C2o-"),
        ):
            rates.plot(ticks, [max(each[key], 1e-2) for each in stages], style, label=label)
        for key, label, style in (
            ("accept_p50_s", "accepted, p50", "C0s--"),
            ("accept_p99_s", "accepted, p99", "C0s:"),
            ("planned_p50_s", "planned, p50", "C2o-"),
            ("planned_p99_s", "planned, p99", "C2o:"),
        ):
            values = [each[key] or float("nan") for each in stages]
            waits.plot(ticks, values, style, label=label)
        waits.axhline(30.0, color="C3", linewidth=0.8)
        rates.set_title(name, fontsize=9)
        rates.set_yscale("log")
        waits.set_yscale("log")
        waits.set_xticks(ticks, [each["name"] for each in stages], fontsize=7, rotation=45)
        waits.set_xlabel("offered, times the capacity", fontsize=8)
    axes[0][0].set_ylabel("requests a second")
    axes[1][0].set_ylabel("seconds")
    axes[0][0].legend(fontsize=7)
    # Beside the curves: nowhere within the picture is room for four names.
    axes[1][-1].legend(fontsize=7, bbox_to_anchor=(1.0, 1.0), loc="upper left")
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
