"""`python -m skyway_lab overload`: run, print the table, write JSON and the figure."""

import argparse
import asyncio
import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import uvloop
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.overload.stages import Finding, Stage, Trial, run
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table


def main(arguments: list[str]) -> int:
    """Run once, or draw earlier runs; 1 when the system is not as it was before."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab overload", description=__doc__)
    parser.add_argument("--storage", choices=("embedded", "production"), default="embedded")
    parser.add_argument("--seconds", type=float, default=180.0, help="of each stage")
    parser.add_argument("--factors", type=float, nargs="+", default=[0.5, 1, 2, 5, 10])
    parser.add_argument("--capacity-per-s", type=float, help="measured when not given")
    parser.add_argument("--probe", type=int, default=150, help="requests to measure the capacity")
    parser.add_argument("--share", type=float, help="of a core for each process, such as 0.06")
    parser.add_argument("--stations", type=int, default=1_000)
    parser.add_argument("--drones", type=int, default=2_000)
    parser.add_argument("--providers", type=int, default=20)
    parser.add_argument("--clock-rate", type=float, default=30.0, help="drones must come back")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, help="where to write the figures")
    parser.add_argument("--draw", type=Path, help="only draw: the PNG of the --from files")
    parser.add_argument("--from", dest="runs", type=Path, nargs="+", default=[], metavar="JSON")
    asked = parser.parse_args(arguments)
    if asked.draw is not None:
        return _draw(asked.runs, asked.draw)
    burst = Burst(
        storage=asked.storage,
        stations=asked.stations,
        drones=asked.drones,
        providers=asked.providers,
        rate_per_s=0.0,
        seconds=asked.seconds,
        clock_rate=asked.clock_rate,
        agents=2,
        longest_wait_s=60.0,
        seed=asked.seed,
    )
    trial = Trial(burst, asked.factors, asked.capacity_per_s, asked.probe, asked.share)
    command = shlex.join(["python", "-m", "skyway_lab", "overload", *arguments])
    about = f"`{command}`: {Machine.here().as_text()}."
    print(f"{about}\n", flush=True)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # as the services
        finding = runner.run(run(trial))
    print(table_of(finding).as_markdown())
    if asked.json is not None:
        name = asked.storage + ("" if asked.share is None else f", {asked.share:.0%} of a core")
        document = {"name": name, "about": about, **asdict(finding)}
        asked.json.write_text(json.dumps(document, indent=1) + "\n")
    is_right = not finding.left and finding.violations.startswith("0 violations")
    return 0 if is_right else 1


def _draw(runs: Sequence[Path], path: Path) -> int:
    from skyway_lab.benchmarks.overload.picture import draw

    found = [json.loads(each.read_text()) for each in runs]
    draw({each["name"]: each for each in found}, path)
    return 0


def table_of(finding: Finding) -> Table:
    """The printed table, with a remark about what is left over."""
    header = ("load", "offered", "accepted", "refused", "done", "accept", "planned", "late")
    table = Table(
        "overload",
        f"Requests a second; capacity {finding.capacity_per_s:.2f}. Seconds p50 / p99.",
        header,
        [_row(each) for each in finding.stages],
    )
    most = max(each.done_per_s for each in finding.stages)
    past = [each.done_per_s for each in finding.stages if each.factor > 1]
    if past:
        table.remarks.append(f"least done past the capacity: {min(past) / most:.0%} of the most")
    table.remarks.append(f"left over after the fall: {dict(finding.left) or 'nothing'}")
    table.remarks.append(finding.violations)
    return table


def _row(stage: Stage) -> tuple[str, ...]:
    refused = ", ".join(f"{count} {status}" for status, count in stage.refused.items())
    return (
        stage.name,
        f"{stage.offered_per_s:.2f}",
        f"{stage.accepted_per_s:.2f}",
        refused or "0",
        f"{stage.done_per_s:.2f}",
        _pair(stage.accept_p50_s, stage.accept_p99_s),
        _pair(stage.planned_p50_s, stage.planned_p99_s),
        f"{stage.late}",
    )


def _pair(middle_s: float | None, slow_s: float | None) -> str:
    return "none" if middle_s is None or slow_s is None else f"{middle_s:.2f} / {slow_s:.2f}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
