"""What an operator asks to be closed, and what is answered."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import AwareDatetime, Field

from skyway.errors import InvalidInput
from skyway.ids import ClosureId, DroneModelId, NetworkId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.http.paging import PageQuery
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.closure import Area, Closure, ClosureKind
from skyway_composition.closures.impact import AffectedMission

Reason = Annotated[str, Field(min_length=1, max_length=500)]


class ClosureOrder(JsonModel):
    """From when and until when, and why; without `from_at` from now, without `until` for good."""

    from_at: AwareDatetime | None = None
    until: AwareDatetime | None = None
    reason: Reason | None = None

    def span_ms(self, now_ms: int) -> tuple[int, int | None]:
        """Its start and end, in ms since 1970.

        Raises
        ------
        InvalidInput
            It ends before it starts, or has ended already.
        """
        from_ms = now_ms if self.from_at is None else moment_to_ms(self.from_at)
        if self.until is None:
            return from_ms, None
        until_ms = moment_to_ms(self.until)
        if until_ms <= max(from_ms, now_ms):
            after = ms_to_moment(max(from_ms, now_ms)).isoformat()
            raise InvalidInput("until", f"{self.until.isoformat()} is not after {after}")
        return from_ms, until_ms


class ZoneOrder(ClosureOrder):
    """An area of a network that nobody flies through, nor lands in."""

    network_id: NetworkId
    area: Area


class GroundStopOrder(JsonModel):
    """No take-off until this is over: of all drones, or of those of a provider or model.

    In one network or everywhere; in an area of it, or in all of it.
    """

    network_id: NetworkId | None = None
    area: Area | None = None
    provider_id: ProviderId | None = None
    drone_model_id: DroneModelId | None = None
    until: AwareDatetime | None = None
    reason: Reason


class DryRun(JsonModel):
    """With `dry_run` nothing is made: the answer says whom it would hit."""

    dry_run: bool = False


class ClosureQuery(PageQuery):
    """Which closures a list shows: those that are not over, or all that ever were."""

    all: bool = False


class _Closed(JsonModel):
    """What is closed: a station, a pad of it, a segment, an area; of a ground stop also whom."""

    kind: ClosureKind
    network_id: NetworkId | None
    station_id: StationId | None
    pad: int | None
    from_id: StationId | None
    to_id: StationId | None
    area: Area | None
    provider_id: ProviderId | None
    drone_model_id: DroneModelId | None
    reason: str | None
    from_at: datetime
    until: datetime | None
    made_at: datetime
    lifted_at: datetime | None


class ClosureInfo(_Closed):
    """What is closed, or was: a station, a pad of it, a segment, an area; and by a ground stop."""

    closure_id: ClosureId


class ClosureMade(_Closed):
    """What was closed, or with `dry_run` would be, and whom that hits; tried out, it has no id."""

    closure_id: ClosureId | None
    affected_missions: tuple[AffectedMission, ...]


def shown(closure: Closure) -> ClosureInfo:
    """A closure as it is listed."""
    return ClosureInfo(closure_id=closure.closure_id, **_members(closure))


def made(closure: Closure, affected: tuple[AffectedMission, ...]) -> ClosureMade:
    """A closure as it is answered to whoever made it, or tried it out."""
    return ClosureMade(
        closure_id=closure.closure_id or None, affected_missions=affected, **_members(closure)
    )


def _members(closure: Closure) -> dict[str, Any]:  # the members of _Closed, checked by the model
    is_segment = closure.kind == "SEGMENT"
    moments = {"from_at": closure.from_ms, "made_at": closure.made_ms}
    perhaps = {"until": closure.until_ms, "lifted_at": closure.lifted_ms}
    return {
        "kind": closure.kind,
        "network_id": closure.network_id,
        "station_id": None if is_segment else closure.station_id,
        "pad": closure.pad,
        "from_id": closure.station_id if is_segment else None,
        "to_id": closure.to_station_id,
        "area": closure.area,
        "provider_id": closure.provider_id,
        "drone_model_id": closure.drone_model_id,
        "reason": closure.reason,
        **{name: ms_to_moment(ms) for name, ms in moments.items()},
        **{name: None if ms is None else ms_to_moment(ms) for name, ms in perhaps.items()},
    }
