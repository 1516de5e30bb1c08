"""`python -m skyway_lab hostile`: run, print flaws and figures; 1 when there is a flaw."""

import asyncio
import logging
import os
import shlex
import sys

import uvloop
from skyway_lab.benchmarks.hostile.budgets import budgets
from skyway_lab.benchmarks.hostile.refusals import refusals
from skyway_lab.benchmarks.hostile.run import run
from skyway_lab.benchmarks.hostile.trial import read_trial
from skyway_lab.benchmarks.planner.machine import Machine


def main(arguments: list[str]) -> int:
    """Run once and print what came of it."""
    trial = read_trial(arguments)
    # With it every process would compile all that it imports, at each start.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    # Rogues lose their connections, as they should.
    logging.getLogger("skyway.runtime.mqtt").setLevel(logging.ERROR)
    command = shlex.join(["python", "-m", "skyway_lab", "hostile", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}.\n\n{trial.as_text()}\n", flush=True)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # as the services
        if trial.only:
            part = refusals() if trial.only == "bodies" else budgets(trial)
            print(runner.run(part).as_markdown())
            return 0
        outcome = runner.run(run(trial))
    for table in outcome.tables():
        print(f"\n{table.as_markdown()}", flush=True)
    print(f"\n{len(outcome.flaws)} flaws")
    for flaw in outcome.flaws:
        print(flaw.as_text())
    return 1 if outcome.flaws else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
