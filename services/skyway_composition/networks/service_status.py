"""Whether a network accepts deliveries now, and what restricts it: for customers, before they ask.

`status_of` is a pure decision. It reads the closures that are in force and the drones that the
registry counts.
"""

from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from datetime import datetime
from types import MappingProxyType
from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.drones import NETWORK_DRONES, DronesOfModel, NetworkDrones
from skyway.ids import ClosureId, DroneModelId, NetworkId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.http.client import ServiceClient
from skyway.units import ms_to_moment
from skyway_composition.closures.closure import Area, Closure
from skyway_composition.closures.network_weather import ClosedNow, NetworkWeather, closed_now

#: The most closures that one answer lists. Our own choice.
_MOST_LISTED: Final = 100

ServiceStatus = Literal["OPEN", "DEGRADED", "PAUSED"]

RestrictionCode = Literal[
    "GROUND_STOP",
    "STATION_CLOSED",
    "PAD_OUT_OF_ORDER",
    "SEGMENT_CLOSED",
    "ZONE_CLOSED",
    "TOO_MUCH_WIND",
    "NO_DRONES",
    "NO_IDLE_DRONES",
]

#: Counts the drones of a network.
CountDrones = Callable[[NetworkId], Awaitable[NetworkDrones]]


class Restriction(JsonModel):
    """One thing that restricts the service, where and for whom; null members do not limit it."""

    code: Annotated[RestrictionCode, Field(description="What restricts the service.")]
    detail: Annotated[
        str,
        Field(
            description="The same as a sentence, with the operator's reason.",
            examples=["station geronimo is closed: roof is being repaired"],
        ),
    ]
    closure_id: Annotated[
        ClosureId | None, Field(description="The closure; null for weather and a lack of drones.")
    ] = None
    station_id: Annotated[
        StationId | None, Field(description="The station, or the start of the segment.")
    ] = None
    to_station_id: Annotated[StationId | None, Field(description="The end of the segment.")] = None
    area: Annotated[Area | None, Field(description="The area of the zone or ground stop.")] = None
    provider_id: Annotated[
        ProviderId | None, Field(description="The only provider that it concerns.")
    ] = None
    model_id: Annotated[
        DroneModelId | None, Field(description="The only drone model that it concerns.")
    ] = None
    until: Annotated[
        datetime | None, Field(description="When it ends, fleet time; null if that is not known.")
    ] = None


class ModelStatus(JsonModel):
    """The drones of one model in a network."""

    model_id: Annotated[DroneModelId, Field(description="Id of the drone model.")]
    max_payload_kg: Annotated[float, Field(description="The most that a drone carries, kg.")]
    status: Annotated[
        ServiceStatus,
        Field(
            description="PAUSED: no drone of this model can begin a delivery now. DEGRADED: all "
            "are busy or must charge. OPEN: some are idle."
        ),
    ]
    registered: Annotated[
        int | None,
        Field(description="Drones of this model in the network; null except for operators."),
    ]
    online: Annotated[
        int | None,
        Field(
            description="Those that are in service and have reported; null except for operators."
        ),
    ]
    idle: Annotated[
        int | None,
        Field(description="Those that are charged and have no mission; null except for operators."),
    ]


class NetworkStatus(JsonModel):
    """Whether a network accepts deliveries now, and what restricts it."""

    network_id: Annotated[NetworkId, Field(description="Id of the network.")]
    at: Annotated[datetime, Field(description="The moment of this answer, fleet time.")]
    status: Annotated[
        ServiceStatus,
        Field(
            description="PAUSED: no drone can begin a delivery now; a new request waits. "
            "DEGRADED: some places, models or providers cannot be used, or all drones are busy. "
            "OPEN: nothing restricts the service."
        ),
    ]
    restrictions: Annotated[
        tuple[Restriction, ...],
        Field(description="What restricts the service, ground stops and missing drones first."),
    ]
    more_restrictions: Annotated[
        int, Field(description="Further restrictions; at most 100 are listed.")
    ]
    models: Annotated[
        tuple[ModelStatus, ...], Field(description="The drone models in the network, by id.")
    ]


def count_drones_at(registry: ServiceClient) -> CountDrones:
    """`CountDrones` that asks the registry."""

    async def count(network_id: NetworkId) -> NetworkDrones:
        path = NETWORK_DRONES.format(network_id=network_id)
        return await registry.call("GET", path, answer=NetworkDrones)

    return count


async def closed_to_models(
    weather: NetworkWeather | None, drones: NetworkDrones, *, now_ms: int
) -> dict[DroneModelId, ClosedNow]:
    """What the weather closes now, by the models of the drones that are online."""
    found: dict[DroneModelId, ClosedNow] = {}
    for each in drones.models:
        if weather is None or not each.online:
            continue
        if await weather.of_plan(each.model, now_ms) is None:
            continue
        closed = closed_now(weather.of_model(each.model), now_ms)
        if closed is not None:
            found[each.model_id] = closed
    return found


def status_of(
    network_id: NetworkId,
    closures: Sequence[Closure],
    drones: NetworkDrones,
    *,
    now_ms: int,
    windy: Mapping[DroneModelId, ClosedNow] = MappingProxyType({}),
) -> NetworkStatus:
    """The status of a network with these closures, all in force now, and these drones.

    `windy` is what the weather closes now to drones of some models.
    """
    stops = [each for each in closures if each.kind == "GROUND_STOP"]
    others = [each for each in closures if each.kind != "GROUND_STOP"]
    # Ground stops of one provider or of one area stop no model everywhere.
    wide = [each for each in stops if each.area is None and each.provider_id is None]
    is_stopped = any(each.drone_model_id is None for each in wide)
    stopped_models = {each.drone_model_id for each in wide}
    stopped_models |= {model_id for model_id, closed in windy.items() if closed.is_all}
    models = [
        _model(each, is_stopped=is_stopped or each.model_id in stopped_models)
        for each in drones.models
    ]
    lacks = list(_lacking(models, is_everyone_counted=not drones.unplaced))
    winds = [_of_wind(model_id, closed) for model_id, closed in windy.items()]
    found = [*map(_restriction, stops), *lacks, *winds, *map(_restriction, others)]
    lacks_all = any(each.code == "NO_DRONES" and each.model_id is None for each in lacks)
    can_any = any(each.status != "PAUSED" for each in models) or drones.unplaced > 0
    is_paused = is_stopped or lacks_all or not can_any
    status: ServiceStatus = "PAUSED" if is_paused else "DEGRADED" if found else "OPEN"
    return NetworkStatus(
        network_id=network_id,
        at=ms_to_moment(now_ms),
        status=status,
        restrictions=tuple(found[:_MOST_LISTED]),
        more_restrictions=max(0, len(found) - _MOST_LISTED),
        models=tuple(models),
    )


def _of_wind(model_id: DroneModelId, closed: ClosedNow) -> Restriction:
    """The restriction of a drone model by the weather."""
    count = f"{closed.closed} of {closed.segments} segments"
    return Restriction(
        code="TOO_MUCH_WIND",
        detail=f"{count} are closed to drones of model {model_id}: the wind is too strong",
        model_id=model_id,
        until=ms_to_moment(closed.until_ms),
    )


def without_counts(status: NetworkStatus) -> NetworkStatus:
    """The status for customers and providers, who must not count the drones of other providers."""
    hidden = {"registered": None, "online": None, "idle": None}
    models = tuple(each.model_copy(update=hidden) for each in status.models)
    return status.model_copy(update={"models": models})


def _model(counted: DronesOfModel, *, is_stopped: bool) -> ModelStatus:
    is_paused = is_stopped or not counted.online
    return ModelStatus(
        model_id=counted.model_id,
        max_payload_kg=counted.max_payload_kg,
        status="PAUSED" if is_paused else "OPEN" if counted.idle else "DEGRADED",
        registered=counted.registered,
        online=counted.online,
        idle=counted.idle,
    )


def _lacking(models: Sequence[ModelStatus], *, is_everyone_counted: bool) -> Iterable[Restriction]:
    """The restrictions by missing drones: of the network, or of some of its models."""
    if is_everyone_counted and not any(each.online for each in models):
        detail = "no drone of the network is in service and online"
        yield Restriction(code="NO_DRONES", detail=detail)
        return
    for each in models:
        if not each.online:
            detail = f"no drone of model {each.model_id} is in service and online"
            yield Restriction(code="NO_DRONES", detail=detail, model_id=each.model_id)
    if is_everyone_counted and not any(each.idle for each in models):
        detail = "all drones are busy or must charge, so a new request waits for one of them"
        yield Restriction(code="NO_IDLE_DRONES", detail=detail)


def _restriction(closure: Closure) -> Restriction:
    code, what = _named(closure)
    until = None if closure.until_ms is None else ms_to_moment(closure.until_ms)
    why = "" if closure.reason is None else f": {closure.reason}"
    return Restriction(
        code=code,
        detail=f"{what}{why}",
        closure_id=closure.closure_id,
        station_id=closure.station_id,
        to_station_id=closure.to_station_id,
        area=closure.area,
        provider_id=closure.provider_id,
        model_id=closure.drone_model_id,
        until=until,
    )


def _named(closure: Closure) -> tuple[RestrictionCode, str]:
    """The code of a closure, and what is closed in words."""
    match closure.kind:
        case "STATION":
            return "STATION_CLOSED", f"station {closure.station_id} is closed"
        case "PAD":
            what = f"pad {closure.pad} of station {closure.station_id} is out of order"
            return "PAD_OUT_OF_ORDER", what
        case "SEGMENT":
            ends = f"{closure.station_id} to {closure.to_station_id}"
            return "SEGMENT_CLOSED", f"the segment from {ends} is closed"
        case "ZONE":
            return "ZONE_CLOSED", "an area is closed to flights"
        case "GROUND_STOP":
            return "GROUND_STOP", f"{_stopped(closure)} may take off"


def _stopped(stop: Closure) -> str:
    of_provider = "" if stop.provider_id is None else f" of provider {stop.provider_id}"
    of_model = "" if stop.drone_model_id is None else f" of model {stop.drone_model_id}"
    where = "" if stop.area is None else " in an area"
    return f"no drone{of_provider}{of_model}{where}"
