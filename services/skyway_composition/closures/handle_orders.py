"""Handle requests about closures of every kind: make, preview, list and lift.

Their REST bodies are here too: an operator's orders, and the answers.
"""

from datetime import datetime
from typing import Annotated, Any, Final

from pydantic import Field

from skyway.bounds import Moment
from skyway.contracts.message import utc_text
from skyway.errors import InvalidInput
from skyway.ids import ClosureId, DroneModelId, NetworkId, ProviderId, StationId
from skyway.json_model import JsonModel, QueryModel
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures import store
from skyway_composition.closures.close import Closings
from skyway_composition.closures.closure import AffectedMission, Area, Closure, ClosureKind
from skyway_composition.closures.store import ClosureFilter

Reason = Annotated[str, Field(min_length=1, max_length=500)]
#: How the field of a reason is described.
_REASON = Field(
    description="Why it is closed, in words for people, at most 500 characters.",
    examples=["roof is being repaired"],
)
Until = Annotated[
    Moment | None,
    Field(description="End of the closure, fleet time; without it until an operator lifts it."),
]

#: A closure has no id before it is made.
_NOT_MADE: Final = ClosureId("")


class ClosureOrder(JsonModel):
    """When something is closed, and why."""

    from_at: Annotated[
        Moment | None,
        Field(description="Start of the closure, fleet time; without it the present moment."),
    ] = None
    until: Until = None
    reason: Annotated[Reason | None, _REASON] = None

    def span_ms(self, now_ms: int) -> tuple[int, int | None]:
        """Start and end of the closure, in ms since 1970.

        Raises
        ------
        InvalidInput
            The closure would end before it starts, or has ended already.
        """
        from_ms = now_ms if self.from_at is None else moment_to_ms(self.from_at)
        if self.until is None:
            return from_ms, None
        until_ms = moment_to_ms(self.until)
        if until_ms <= max(from_ms, now_ms):
            after = "the fleet time" if now_ms >= from_ms else "from_at"
            detail = f"{after}, {utc_text(ms_to_moment(max(from_ms, now_ms)))}"
            raise InvalidInput("until", f"{utc_text(self.until)} is not after {detail}")
        return from_ms, until_ms


class ZoneOrder(ClosureOrder):
    """An area of a network where no drone may fly or land."""

    network_id: Annotated[NetworkId, Field(description="Network that the zone belongs to.")]
    area: Annotated[Area, Field(description="The closed area.")]


class GroundStopOrder(JsonModel):
    """No drone may take off until the stop ends; every member but `reason` limits the stop."""

    network_id: Annotated[
        NetworkId | None, Field(description="Only in this network; without it everywhere.")
    ] = None
    area: Annotated[
        Area | None, Field(description="Only at stations in this area; without it at all.")
    ] = None
    provider_id: Annotated[
        ProviderId | None, Field(description="Only drones of this provider; without it all.")
    ] = None
    drone_model_id: Annotated[
        DroneModelId | None, Field(description="Only drones of this model; without it all.")
    ] = None
    until: Until = None
    reason: Annotated[Reason, _REASON]


class DryRun(QueryModel):
    """Whether to make a closure or only to preview it."""

    dry_run: Annotated[
        bool,
        Field(
            description="Make nothing; the answer names the missions that would be affected, and "
            "how much later the first 20 would deliver."
        ),
    ] = False


class ClosureQuery(PageQuery):
    """Which closures a list shows."""

    all: Annotated[
        bool, Field(description="Also list closures that have ended or were lifted.")
    ] = False


class _Closed(JsonModel):
    kind: Annotated[ClosureKind, Field(description="What is closed.")]
    network_id: Annotated[
        NetworkId | None, Field(description="Network of the closure; null means every network.")
    ]
    station_id: Annotated[
        StationId | None, Field(description="Closed station, or station of the closed pad.")
    ]
    pad: Annotated[int | None, Field(description="Number of the pad that is out of order, from 0.")]
    from_id: Annotated[StationId | None, Field(description="Start of the closed segment.")]
    to_id: Annotated[StationId | None, Field(description="End of the closed segment.")]
    area: Annotated[Area | None, Field(description="Area of the zone or of the ground stop.")]
    provider_id: Annotated[
        ProviderId | None, Field(description="The only provider that a ground stop concerns.")
    ]
    drone_model_id: Annotated[
        DroneModelId | None,
        Field(description="The only drone model that a ground stop concerns."),
    ]
    reason: Annotated[str | None, Field(description="Why it is closed, in words for people.")]
    from_at: Annotated[datetime, Field(description="Start of the closure, fleet time.")]
    until: Annotated[
        datetime | None,
        Field(description="End of the closure, fleet time; null until an operator lifts it."),
    ]
    made_at: Annotated[
        datetime, Field(description="When the operator made the closure, fleet time.")
    ]
    lifted_at: Annotated[
        datetime | None, Field(description="When an operator lifted the closure, fleet time.")
    ]


class ClosureInfo(_Closed):
    """A closure; it may have ended, or an operator may have lifted it."""

    closure_id: Annotated[ClosureId, Field(description="Id of the closure.")]


class ClosureMade(_Closed):
    """A closure that was made, or a preview of one, with the missions that it affects."""

    closure_id: Annotated[
        ClosureId | None, Field(description="Id of the closure; null for a dry run.")
    ]
    affected_missions: Annotated[
        tuple[AffectedMission, ...],
        Field(description="Missions that need a new plan because of it, the earliest first."),
    ]
    missions_without_delay: Annotated[
        int,
        Field(description="Affected missions for which no delay was planned: a dry run plans 20."),
    ]


#: The answer to a POST that made a closure; a dry run is answered with 200.
MADE: Final[dict[int | str, dict[str, Any]]] = {201: {"model": ClosureMade}}


def closure_of(
    kind: ClosureKind,
    network_id: NetworkId | None,
    closings: Closings,
    order: ClosureOrder | None,
    **members: Any,  # the members of Closure that this kind has
) -> Closure:
    """The closure that an order asks for; it is not made yet."""
    order = order or ClosureOrder()
    from_ms, until_ms = order.span_ms(closings.now_ms)
    return Closure(
        closure_id=_NOT_MADE,
        kind=kind,
        network_id=network_id,
        from_ms=from_ms,
        made_ms=closings.now_ms,
        until_ms=until_ms,
        reason=order.reason,
        **members,
    )


def status_of(query: DryRun) -> int:
    """The HTTP status: 201 when a closure is made, 200 for a dry run."""
    return 200 if query.dry_run else 201


async def make_or_preview(closings: Closings, closure: Closure, query: DryRun) -> ClosureMade:
    """Make the closure, or preview it for a dry run; the answer names the affected missions."""
    if query.dry_run:
        affected = await closings.preview(closure)
    else:
        closure, affected = await closings.make(closure)
    return ClosureMade(
        closure_id=closure.closure_id or None,
        affected_missions=affected,
        missions_without_delay=sum(each.delay is None for each in affected),
        **_members(closure),
    )


async def page_of_kind(
    closings: Closings,
    caller: Caller,
    query: ClosureQuery,
    kind: ClosureKind,
    *,
    station_id: StationId | None = None,
    pad: int | None = None,
    to_station_id: StationId | None = None,
) -> Page[ClosureInfo]:
    """The closures of this kind and place, in order of their ids."""
    caller.must_be("customer", "provider", "operator", "service")
    if station_id is not None:
        await closings.around(station_id)
    chosen = ClosureFilter(
        kind=kind,
        lasting_beyond_ms=None if query.all else closings.now_ms,
        station_id=station_id,
        pad=pad,
        to_station_id=to_station_id,
    )
    async with closings.db.read() as connection:
        rows = await store.page(
            connection, chosen, after=query.after_id() or "", limit=query.limit + 1
        )
    return page_of(rows, query, item=shown, sort_key=lambda row: (row.closure_id,))


async def lift(
    closings: Closings,
    caller: Caller,
    closure_id: ClosureId,
    kind: ClosureKind,
    *,
    station_id: StationId | None = None,
    pad: int | None = None,
    to_station_id: StationId | None = None,
) -> None:
    """Lift a closure of this kind and place.

    Raises
    ------
    NotFound
        There is no such closure, or it has another kind or place.
    """
    caller.must_be("operator")
    async with closings.db.read() as connection:
        closure = await store.get(connection, closure_id)
    asked = (kind, station_id, pad, to_station_id)
    if closure is None or asked != (
        closure.kind,
        closure.station_id,
        closure.pad,
        closure.to_station_id,
    ):
        raise NotFound("closure", closure_id)
    await closings.lift(closure)


def shown(closure: Closure) -> ClosureInfo:
    """A closure as lists show it."""
    return ClosureInfo(closure_id=closure.closure_id, **_members(closure))


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
