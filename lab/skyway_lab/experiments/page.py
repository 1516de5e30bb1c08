"""The experiments by name, and the page of their results.

The page is put together from one fragment for each experiment. One experiment can run again alone:
the other sections of the page stay as they were measured.
"""

import os
import platform
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from skyway_lab.experiments.ablations import ablations
from skyway_lab.experiments.booked_fleet import booked_fleet
from skyway_lab.experiments.causes import causes
from skyway_lab.experiments.congestion import congestion
from skyway_lab.experiments.destinations import destinations
from skyway_lab.experiments.dispatched_hour.section import dispatch
from skyway_lab.experiments.fleet_hour.section import fleet
from skyway_lab.experiments.flown import flown
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.open_settings import open_settings
from skyway_lab.experiments.paper import paper
from skyway_lab.experiments.paper_recharging import paper_recharging
from skyway_lab.experiments.recharging import recharging
from skyway_lab.experiments.report import Section, duration
from skyway_lab.experiments.scale import scale
from skyway_lab.experiments.weather import weather
from skyway_lab.experiments.widening import widening

PARTS: Mapping[str, Callable[[Laboratory], Section]] = MappingProxyType(
    {
        "paper": paper,
        "open-settings": open_settings,
        "paper-recharging": paper_recharging,
        "destinations": destinations,
        "widening": widening,
        "causes": causes,
        "recharging": recharging,
        "congestion": congestion,
        "booked-fleet": booked_fleet,
        "fleet": fleet,
        "dispatch": dispatch,
        "ablations": ablations,
        "flown": flown,
        "weather": weather,
        "scale": scale,
    }
)

#: About how long a quick run of each part takes on a slow machine, seconds of processor time: three
#: times what each took on a core of an AMD EPYC, once the planner was compiled.
QUICK_S: Mapping[str, int] = MappingProxyType(
    {
        "paper": 7,
        "open-settings": 3,
        "paper-recharging": 6,
        "destinations": 4,
        "widening": 3,
        "causes": 3,
        "recharging": 1,
        "congestion": 3,
        "booked-fleet": 1,
        "fleet": 6,
        "dispatch": 6,
        "ablations": 2,
        "flown": 3,
        "weather": 3,
        "scale": 2,
    }
)

PAGE = "experiments.md"

_HEAD = """# Experiments

These experiments repeat the paper's evaluation and go beyond it. `skyway experiment --out docs`
wrote this page, the figures and a CSV row for every run (`docs/experiments/`). `--redraw` writes
sections and figures again from these rows.
Every number below comes from that run, and each section names its seed. Times are wall
times of single processes; two processes ran at a time on two cores. All contestants are measured on
the same instances, within the same process, one after the other. A run that reached its time limit
is a censored datum: in a mean it counts with its limit (≥), in a median it counts as later than any
other, and it is never left out. Intervals are 95 % bootstrap intervals with a fixed seed.

`heuristic` is the paper's Algorithm 1, `exhaustive` is its baseline, and `exact` is our planner's
default, compiled by numba. `exact, plain Python` is the same code with numba switched off, so that
all contestants are also measured in one language. A **gap** is how much later a plan delivers than
the best plan found for the instance, as a share of the best delivery time.
"""


def write_fragment(
    laboratory: Laboratory, name: str, section: Section, *, elapsed_s: float
) -> None:
    """Write this section beside its figures; `write_page` puts it on the page.

    A section that is redrawn keeps its line about the run that measured it.
    """
    path = laboratory.folder / f"{name}.md"
    size = laboratory.size(quick="quick", full="full")
    measured = (
        f"*Seed {laboratory.seed}, {size} run, {duration(elapsed_s)}; {platform.machine()}, "
        f"{os.cpu_count()} cores, Python {platform.python_version()}.*"
    )
    if laboratory.redraws:
        measured = path.read_text(encoding="utf-8").splitlines()[-1]
    findings = "\n".join(f"- {each.question}: {each.answer}" for each in section.findings)
    text = "\n\n".join((f"## {section.title}", findings, *section.paragraphs, measured))
    path.write_text(text + "\n", encoding="utf-8")


def write_page(folder: Path) -> Path:
    """Write the page of all fragments in this folder beside the folder."""
    fragments = [folder / f"{name}.md" for name in PARTS]
    texts = [
        re.sub(r"(!\[[^\]]*\]\()", rf"\1{folder.name}/", path.read_text(encoding="utf-8"))
        for path in fragments
        if path.exists()
    ]
    page = folder.parent / PAGE
    page.write_text("\n".join((_HEAD, *texts)), encoding="utf-8")
    return page
