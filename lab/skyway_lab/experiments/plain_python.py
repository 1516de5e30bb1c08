"""A second process in which numba compiles nothing: `exact` in the paper's own language.

The two processes exchange lines of JSON: a problem in, its plan out.
"""

import atexit
import os
import sys
from functools import cache
from subprocess import PIPE, Popen
from typing import Self

from skyway.delivery.plan import Plan
from skyway.errors import SkywayError
from skyway.planner.problem import Problem


class PlainPythonEnded(SkywayError):
    """The process without compiled code ended before it answered."""


class PlainPython:
    """The process. It composes without compiled code and ends with the process that made it."""

    def __init__(self) -> None:
        self._process = Popen(
            [sys.executable, "-m", "skyway_lab.experiments.plain_python"],
            env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
            stdin=PIPE,
            stdout=PIPE,
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_raised: object) -> None:
        self._process.communicate()

    def compose(self, problem: Problem) -> Plan:
        """The plan for this problem; its `elapsed_s` is measured in the other process.

        Raises
        ------
        PlainPythonEnded
            The process ended without an answer.
        """
        asks, answers = self._process.stdin, self._process.stdout
        if asks is None or answers is None:
            raise PlainPythonEnded("the process has no pipes")
        asks.write(problem.model_dump_json() + "\n")
        asks.flush()
        answer = answers.readline()
        if not answer:
            raise PlainPythonEnded(f"it ended with code {self._process.wait()}")
        return Plan.model_validate_json(answer)


@cache
def plain_python() -> PlainPython:
    """The only such process of this one: the first call starts it, and it ends with this one."""
    started = PlainPython()
    atexit.register(started.__exit__)
    return started


def _answer_all() -> None:
    """Compose the problems on standard input, line by line, until the input ends."""
    from skyway.planner.compose import compose

    for line in sys.stdin:
        plan = compose(Problem.model_validate_json(line))
        sys.stdout.write(plan.model_dump_json() + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    _answer_all()
