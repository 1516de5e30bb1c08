"""The anchor: the earliest place and moment from which the plan of a mission can be changed.

A drone that stands can be told otherwise at once, but for a hand-over or a loading that it is at.
One that flies has released its steps up to the next landing; they stay as they are, unless one of
them leads to what is closed, or it has to land as soon as it can.
"""

from dataclasses import dataclass

from skyway.ids import PackageId, StationId


@dataclass(frozen=True, slots=True)
class Anchor:
    """Where, when and with how much a new plan begins, after `last_valid_step`.

    `is_divert` when released steps or the one under way are replaced. `is_in_the_air` when the
    drone cannot stand there, only fly on. `at_ms` may be later than the drone gets there, so that
    the new plan is there before it begins.
    """

    station_id: StationId
    at_ms: int
    soc: float
    last_valid_step: int
    carried: frozenset[PackageId]
    has_loaded: bool
    is_divert: bool = False
    is_in_the_air: bool = False

    @property
    def first_step(self) -> int:
        """The first step of the new plan."""
        return self.last_valid_step + 1
