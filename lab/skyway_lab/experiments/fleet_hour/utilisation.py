"""What drones do with their time: service, approach, charging, standby, or nothing."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal

#: approach: from the start of a mission until the drone loads. service: from then on until the last
#: hand-over. standby: flights and waits after the last hand-over. charging: on a pad, at any time.
Use = Literal["service", "approach", "charging", "standby"]

USES: Final[tuple[Use, ...]] = ("service", "approach", "charging", "standby")


@dataclass(frozen=True, slots=True)
class StepTime:
    """The kind of a step of a mission (FLY, WAIT, RECHARGE, ...), and its time, milliseconds."""

    kind: str
    start_ms: int
    end_ms: int


def spent_ms(
    steps: Iterable[StepTime], *, served_ms: int, from_ms: int, until_ms: int
) -> Mapping[Use, int]:
    """The time that one mission spends on each use within [from_ms, until_ms), milliseconds.

    Parameters
    ----------
    steps
        The steps of the mission in order.
    served_ms
        The end of the mission's last hand-over.
    """
    spent: dict[Use, int] = dict.fromkeys(USES, 0)
    for use, step in _with_use(steps, served_ms):
        spent[use] += max(0, min(step.end_ms, until_ms) - max(step.start_ms, from_ms))
    return spent


def _with_use(steps: Iterable[StepTime], served_ms: int) -> Iterator[tuple[Use, StepTime]]:
    has_loaded = False
    for step in steps:
        has_loaded = has_loaded or step.kind == "PICK_UP"
        if step.kind == "RECHARGE":
            yield "charging", step
        elif step.start_ms >= served_ms:
            yield "standby", step
        else:
            yield ("service" if has_loaded else "approach"), step
