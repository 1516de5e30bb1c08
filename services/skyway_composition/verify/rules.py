"""The invariants that one statement each finds broken."""

from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import Select, and_, func, literal_column, select

from skyway_composition.tables import (
    custody,
    deliveries,
    first_planned_end_ms,
    instructions,
    is_live,
    is_under_way,
    mission_steps,
    missions,
    network_versions,
    networks,
    pad_reservations,
)

_one = pad_reservations.alias("one")
_other = pad_reservations.alias("other")
_sent = instructions.alias("sent")
_before = instructions.alias("before")
_link = custody.alias("link")
_previous = custody.alias("previous")

#: What must not be found: rows of (subject,) by the sentence that they make false.
RULES: Final[Mapping[str, Select[*tuple[Any, ...]]]] = {
    "I1 no pad holds two overlapping reservations": select(_one.c.station_id).join(
        _other,
        and_(
            _one.c.station_id == _other.c.station_id,
            _one.c.pad == _other.c.pad,
            _one.c.start_ms < _other.c.end_ms,
            _other.c.start_ms < _one.c.end_ms,
            (_one.c.start_ms != _other.c.start_ms) | (_one.c.mission_id != _other.c.mission_id),
        ),
    ),
    "I2 a drone is on at most one mission": select(missions.c.drone_id)
    .where(is_live)
    .group_by(missions.c.drone_id)
    .having(func.count() > 1),
    "I3 a reservation has a live mission": select(pad_reservations.c.mission_id)
    .join(missions, missions.c.mission_id == pad_reservations.c.mission_id)
    .where(~is_live),
    "I4 a mission was sent to its drone": select(missions.c.mission_id).where(
        missions.c.mission_id.not_in(
            select(instructions.c.mission_id).where(instructions.c.kind == "MISSION")
        )
    ),
    "I4 a mission has steps": select(missions.c.mission_id).where(
        missions.c.mission_id.not_in(select(mission_steps.c.mission_id))
    ),
    "a mission is looked at when its next step should have ended": select(
        missions.c.mission_id
    ).where(is_under_way, missions.c.next_end_ms.is_distinct_from(first_planned_end_ms)),
    "a closed delivery has no live mission": select(missions.c.mission_id)
    .join(deliveries, deliveries.c.delivery_id == missions.c.delivery_id)
    .where(deliveries.c.closed_ms.is_not(None), is_live),
    "I7 instructions of a stream have no gaps": select(_sent.c.instruction_id).where(
        _sent.c.seq > 1,
        ~select(literal_column("1"))
        .where(
            _before.c.drone_id == _sent.c.drone_id,
            _before.c.stream == _sent.c.stream,
            _before.c.seq == _sent.c.seq - 1,
        )
        .exists(),
    ),
    "I6 a chain of custody has no gaps": select(_link.c.package_id).where(
        _link.c.seq > 1,
        ~select(literal_column("1"))
        .where(
            _previous.c.delivery_id == _link.c.delivery_id,
            _previous.c.package_id == _link.c.package_id,
            _previous.c.seq == _link.c.seq - 1,
        )
        .exists(),
    ),
    "I6 a package is delivered once": select(custody.c.package_id)
    .where(custody.c.custodian_kind == "RECIPIENT")
    .group_by(custody.c.delivery_id, custody.c.package_id)
    .having(func.count() > 1),
    "I6 nothing follows the recipient": select(_link.c.package_id).join(
        _previous,
        and_(
            _previous.c.delivery_id == _link.c.delivery_id,
            _previous.c.package_id == _link.c.package_id,
            _previous.c.seq < _link.c.seq,
            _previous.c.custodian_kind == "RECIPIENT",
        ),
    ),
    "I12 a current version is kept": select(networks.c.network_id).where(
        ~select(literal_column("1"))
        .where(
            network_versions.c.network_id == networks.c.network_id,
            network_versions.c.version == networks.c.version,
            network_versions.c.sha256 == networks.c.sha256,
        )
        .exists()
    ),
}
