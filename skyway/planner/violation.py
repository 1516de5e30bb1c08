"""A rule of the problem that a plan breaks."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Violation:
    """What is wrong; `step` counts the plan's steps from 0, None for the plan as a whole."""

    step: int | None
    rule: str
    detail: str

    def __str__(self) -> str:
        where = "plan" if self.step is None else f"steps.{self.step}"
        return f"{where}: {self.rule}: {self.detail}"
