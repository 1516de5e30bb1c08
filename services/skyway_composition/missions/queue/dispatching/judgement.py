"""Decides whether another order is worth adopting: a pure decision.

What it saves in seconds and energy must be more than the price of its moves, and no promise may be
later by more than the tolerance.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from skyway.ids import DroneId, PackageId
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.queue.plan_queue import etas_ms, latest_ms

#: What it costs to give a mission to another drone, in seconds of one delivery. The same is the
#: least that a change must save. Our own choice: plans that people look at should seldom change.
MOVE_S: Final = 60.0

#: What a kWh costs, in seconds of one delivery. Our own choice: a flight that a merge saves (about
#: 0.1 kWh) is worth a little more than `MOVE_S`. Flights charge a kWh in about four hours.
ENERGY_S_PER_KWH: Final = 1_000.0

_J_PER_KWH: Final = 3.6e6

#: How much a second of a PRIORITY delivery counts, if one of a STANDARD delivery counts 1. Our own
#: choice.
_PRIORITY_WEIGHT: Final = 2.0


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a change saves, and how many missions move.

    `saved_s` are seconds of a STANDARD delivery, and `saved_j` joules of flights; each is negative
    if the change costs some. A mission moves to another drone, or its packages to another mission.
    `late` are the drones that would deliver later than allowed.
    """

    saved_s: float
    saved_j: float
    moves: int
    late: frozenset[DroneId]

    @property
    def is_better(self) -> bool:
        """Whether the change saves more than its price, and keeps all promises."""
        saved_s = self.saved_s + ENERGY_S_PER_KWH * self.saved_j / _J_PER_KWH
        return not self.late and saved_s > MOVE_S * max(1, self.moves)


def judge(
    changes: Iterable[tuple[MissionRecord, MissionRecord]],
    *,
    tolerance_s: float,
    guests: Sequence[MissionRecord] = (),
) -> Judgement:
    """The judgement on missions that change from the first to the second record of each pair.

    The `guests` end, because other missions carry their packages.
    """
    saved_s, moves, late = 0.0, len(guests), set[DroneId]()
    saved_j = sum(_energy_j(each) for each in guests)
    for before, after in changes:
        earlier, later = etas_ms(before), etas_ms(after)
        latest = latest_ms(before, tolerance_s=tolerance_s)
        # Packages that join the mission have no promise yet.
        if any(later[package_id] > at_ms for package_id, at_ms in latest.items()):
            late.add(after.drone_id)
        saved_ms = _ends_ms(before, earlier) - _ends_ms(before, later)
        saved_s += weight_of(before) * saved_ms / 1000
        saved_j += _energy_j(before) - _energy_j(after)
        moves += before.drone_id != after.drone_id
    return Judgement(saved_s, saved_j, moves, frozenset(late))


def _energy_j(record: MissionRecord) -> float:
    """The energy of the flights until the last hand-over."""
    return record.mission.plan.energy_j or 0.0


def weight_of(record: MissionRecord) -> float:
    """How much a second of this delivery counts."""
    return _PRIORITY_WEIGHT if record.request.qos.priority == "PRIORITY" else 1.0


def _ends_ms(record: MissionRecord, etas_ms: Mapping[PackageId, int]) -> int:
    """The sum of the last arrivals of the deliveries that the mission flies for."""
    own = {each.package_id for each in record.mission.packages}
    shares = [own & {*each.packages} for each in record.shares] or [own]
    return sum(max(etas_ms[each] for each in share) for share in shares if share)
