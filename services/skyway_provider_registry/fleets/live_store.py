"""All SQL of the live picture: the drones that have changed since the gateway asked last."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Self

from sqlalchemy import BigInteger, Select, and_, bindparam, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.live import LiveDrone, LiveDrones
from skyway.drone.model import DroneModel
from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import DroneModelId
from skyway.runtime.sql.connection import AnyRow
from skyway.units import moment_to_ms
from skyway_provider_registry.change_store import ONLY_ROW
from skyway_provider_registry.fleets.drone import state_of
from skyway_provider_registry.fleets.store import every_model
from skyway_provider_registry.presence.drone_presence import SILENCE, Presence, condition_of
from skyway_provider_registry.presence.store import PRESENCE, presence_of
from skyway_provider_registry.tables import changes, drones

#: Samples of other replicas may be committed so much later than they were received, wall ms. They
#: have no numbers of changes, so all samples of this time are read again.
_LATE_COMMITS_MS: Final = 2_000

#: Landings of a drone in the picture: where it could land instead, not everywhere it could.
_MOST_LANDINGS: Final = 3

_SILENCE_MS: Final = round(SILENCE.total_seconds() * 1000)

_presence = PRESENCE.subquery("drone_presence")
_EVERY_DRONE: Final = (
    select(
        drones.c.provider_id,
        drones.c.model_id,
        drones.c.name,
        drones.c.home_longitude_deg,
        drones.c.home_latitude_deg,
        drones.c.initial_soc,
        drones.c.is_in_maintenance,
        _presence,
    )
    .join_from(drones, _presence, _presence.c.drone_id == drones.c.drone_id)
    .order_by(drones.c.drone_id)
)
_CHANGED_DRONES: Final = _EVERY_DRONE.where(
    or_(
        _presence.c.changed > bindparam("change", type_=BigInteger),
        _presence.c.last_seen_wall_ms >= bindparam("seen_ms", type_=BigInteger),
        # They have fallen silent meanwhile, which nobody writes down.
        and_(
            _presence.c.last_seen_wall_ms >= bindparam("silent_from_ms", type_=BigInteger),
            _presence.c.last_seen_wall_ms < bindparam("silent_to_ms", type_=BigInteger),
        ),
    )
)
_MARKS: Final = select(changes.c.latest, changes.c.removals).where(changes.c.only == ONLY_ROW)


@dataclass(frozen=True, slots=True)
class Mark:
    """Up to where the gateway has seen the drones: numbers of changes, and wall time."""

    change: int
    removals: int
    wall_ms: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """The mark in the text of an answer.

        Raises
        ------
        InvalidInput
            The text is not a mark.
        """
        try:
            change, removals, wall_ms = map(int, text.split("."))
        except ValueError as error:
            raise InvalidInput("since", "not a mark of an earlier answer") from error
        return cls(change, removals, wall_ms)

    def __str__(self) -> str:
        return f"{self.change}.{self.removals}.{self.wall_ms}"


async def live_drones(
    connection: AsyncConnection, since: Mark | None, *, wall_now: datetime
) -> LiveDrones:
    """The drones that have changed since a mark; all drones without one, or after a removal."""
    # The marks come first: what is committed after this read is read next time.
    row = (await connection.execute(_MARKS)).one_or_none()
    latest, removals = (0, 0) if row is None else (row.latest, row.removals)
    now = Mark(latest, removals, moment_to_ms(wall_now))
    is_whole = since is None or since.removals != removals or since.change > latest
    statement: Select[*tuple[object, ...]] = _EVERY_DRONE if is_whole else _CHANGED_DRONES
    bounds = {} if since is None or is_whole else _bounds(since, now)
    rows = (await connection.execute(statement, bounds)).all()
    models = await every_model(connection) if rows else {}
    return LiveDrones.model_construct(
        mark=str(now),
        is_whole=is_whole,
        drones=tuple(_live_drone(row, models, wall_now) for row in rows),
    )


def _bounds(since: Mark, now: Mark) -> dict[str, int]:
    return {
        "change": since.change,
        "seen_ms": since.wall_ms - _LATE_COMMITS_MS,
        "silent_from_ms": since.wall_ms - _SILENCE_MS - _LATE_COMMITS_MS,
        "silent_to_ms": now.wall_ms - _SILENCE_MS,
    }


def _live_drone(
    row: AnyRow, models: Mapping[DroneModelId, DroneModel], wall_now: datetime
) -> LiveDrone:
    presence, condition = presence_of(row), condition_of(row.condition)
    home = Position(row.home_longitude_deg, row.home_latitude_deg), row.initial_soc
    position, soc = presence.place or home
    state = presence.state
    is_flying = state is not None and state.activity == "FLYING"
    health = condition.health if is_flying else None
    return LiveDrone.model_construct(
        drone_id=row.drone_id,
        provider_id=row.provider_id,
        model_id=row.model_id,
        name=row.name,
        state=state_of(presence, is_in_maintenance=row.is_in_maintenance, wall_now=wall_now),
        activity=None if state is None else state.activity,
        at=_seen_at(presence),
        position=position,
        soc=soc,
        station_id=None if state is None else state.station_id,
        mission_id=presence.mission_id,
        faults=condition.faults,
        must_land_at=(
            None
            if state is None or health is None
            else _must_land_at(state.at, health.range_m, models[row.model_id])
        ),
        safe_landings=() if health is None else health.safe_landings[:_MOST_LANDINGS],
    )


def _seen_at(presence: Presence) -> datetime | None:
    """When the drone was at its `place`."""
    state, sample = presence.state, presence.sample
    if state is None:
        return None
    if sample is not None and presence.place == (sample.position, sample.soc):
        return max(state.at, sample.at) if sample.session == state.session else state.at
    return state.at


def _must_land_at(at: datetime, range_m: float, model: DroneModel) -> datetime:
    """When a drone with this range is down to its reserve."""
    return at + timedelta(seconds=range_m / model.speed_empty_mps)
