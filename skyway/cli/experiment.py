"""`skyway experiment`: the paper's evaluation made again, and what lies past it."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skyway.cli.data_folder import data_folder, keep_kernels
from skyway.cli.dispatch import RayAddress
from skyway.cli.gateway import fail

if TYPE_CHECKING:
    from skyway_lab.experiments.report import Section


def experiment_command(
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Tiny sizes: all experiments within 90 s of processor time."),
    ] = False,
    only: Annotated[
        list[str] | None, typer.Option(help="Run only this part; repeat it for more.")
    ] = None,
    out: Annotated[
        Path, typer.Option(help="Where experiments.md and the folder experiments/ are written.")
    ] = Path("results"),
    seed: Annotated[int, typer.Option(help="Draws the instances; only times differ then.")] = 1,
    redraw: Annotated[
        bool,
        typer.Option(
            "--redraw",
            help="Run nothing: write the section and figures again from the CSV file of an earlier "
            "run. For the parts that compare planners on instances.",
        ),
    ] = False,
    ray_address: RayAddress = None,
) -> None:
    """Measure the planner against the paper's strategies; write a page, figures and CSV files."""
    if find_spec("skyway_lab") is None:
        fail("experiments are a package of their own: pip install ./lab in a checkout of Skyway")
    keep_kernels(data_folder())
    # Late: matplotlib, numpy and numba are heavy, and other commands do without them.
    from skyway_lab.experiments.figures import require_matplotlib
    from skyway_lab.experiments.page import PARTS

    unknown = [name for name in only or () if name not in PARTS]
    if unknown:
        raise typer.BadParameter(
            f"{unknown[0]!r} is not a part; there are {', '.join(PARTS)}", param_hint="--only"
        )
    require_matplotlib()
    names = [name for name in PARTS if not only or name in only]
    sections = _run(
        names,
        is_quick=quick,
        folder=out / "experiments",
        seed=seed,
        ray_address=ray_address,
        redraws=redraw,
    )
    _show(sections)


def _run(
    names: Sequence[str],
    *,
    is_quick: bool,
    folder: Path,
    seed: int,
    ray_address: str | None,
    redraws: bool,
) -> Mapping[str, "Section"]:
    """Run these parts one after the other; the page is written anew after each."""
    from skyway_lab.experiments.laboratory import open_laboratory
    from skyway_lab.experiments.page import PARTS, QUICK_S, write_fragment, write_page

    from skyway.planner.stop import stopwatch

    sections = {}
    laboratories = open_laboratory(
        seed=seed, is_quick=is_quick, folder=folder, ray_address=ray_address, redraws=redraws
    )
    with laboratories as laboratory:
        for name in names:
            if is_quick:
                typer.echo(f"{name}: about {QUICK_S[name]} s on one core", err=True)
            elapsed_s = stopwatch()
            section = sections[name] = PARTS[name](laboratory)
            write_fragment(laboratory, name, section, elapsed_s=elapsed_s())
            page = write_page(folder)
    typer.echo(f"{page}, figures and CSV files in {folder}", err=True)
    return sections


def _show(sections: Mapping[str, "Section"]) -> None:
    """The summary: a line for every finding."""
    from rich.console import Console
    from rich.table import Table

    table = Table("part", "question", "answer")
    for name, section in sections.items():
        for number, finding in enumerate(section.findings):
            table.add_row("" if number else name, finding.question, finding.answer)
        table.add_section()
    Console().print(table)
