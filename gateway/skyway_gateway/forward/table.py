"""Every public call that is not the gateway's own: path, service, roles. Nothing else is passed."""

from dataclasses import dataclass
from typing import Final, Literal

from skyway.runtime.http.body_bounds import BODY_LIMIT_BYTES
from skyway.runtime.http.identity import Caller, CallerRole

Method = Literal["GET", "POST", "PUT", "PATCH", "DELETE"]
Service = Literal["registry", "composition"]

_ANY: Final[tuple[CallerRole, ...]] = ("customer", "provider", "operator")
_ANY_OR_DRONE: Final[tuple[CallerRole, ...]] = (*_ANY, "drone")
_FLEETS: Final[tuple[CallerRole, ...]] = ("provider", "operator")
_FLEETS_OR_DRONE: Final[tuple[CallerRole, ...]] = (*_FLEETS, "drone")
_DRONE: Final[tuple[CallerRole, ...]] = ("drone",)
_OPERATOR: Final[tuple[CallerRole, ...]] = ("operator",)

#: Bytes and wall seconds for what is large or heavy (docs/reference/rest.md).
_NETWORK_BYTES: Final = 256 * 1024 * 1024
_FORECAST_BYTES: Final = 16 * 1024 * 1024
_HEAVY_S: Final = 180.0
#: Bytes of a station with its segments in a network's GeoJSON; a city's have 900.
_STATION_BYTES: Final = 1024


@dataclass(frozen=True, slots=True)
class Forwarded:
    """One call: who answers it, and who may make it. `{provider_id}` is a provider's own only.

    Without roles nobody has to say who they are: the body holds the proof.
    """

    method: Method
    path: str
    service: Service
    roles: tuple[CallerRole, ...]
    #: The most bytes of its body, if they do not follow from its schema.
    limit_bytes: int | None = None
    timeout_s: float = 30.0
    #: Whether it keeps composition busy, so that tenants take turns.
    is_planning: bool = False
    #: Whether it reads much of a database or sends much, so that tenants take turns, too.
    is_report: bool = False
    #: Whether it has a `dry_run`, which changes nothing and is planning.
    has_dry_run: bool = False


def _world_rows(path: str) -> tuple[Forwarded, ...]:
    """What operators make and lift in the world, and everybody may see."""
    return (
        Forwarded("POST", path, "composition", _OPERATOR, has_dry_run=True),
        Forwarded("GET", path, "composition", _ANY),
        Forwarded("DELETE", f"{path}/{{closure_id}}", "composition", _OPERATOR),
    )


def _batteries_and_maintenance(provider: str) -> tuple[Forwarded, ...]:
    """What a provider notes about its batteries, and about the maintenance of its drones."""
    battery, rule = f"{provider}/batteries/{{battery_id}}", f"{provider}/maintenance-rules"
    drone = f"{provider}/drones/{{drone_id}}"
    calls: tuple[tuple[Method, str], ...] = (
        ("POST", f"{provider}/batteries"),
        ("GET", f"{provider}/batteries"),
        ("GET", battery),
        ("DELETE", battery),
        ("PUT", f"{drone}/battery"),
        ("DELETE", f"{drone}/battery"),
        ("POST", f"{drone}/maintenance"),
        ("GET", rule),
        ("PUT", f"{rule}/{{model_id}}"),
        ("DELETE", f"{rule}/{{model_id}}"),
    )
    return tuple(Forwarded(method, path, "registry", _FLEETS) for method, path in calls)


_PROVIDER: Final = "/v1/providers/{provider_id}"
_ONE_DRONE: Final = f"{_PROVIDER}/drones/{{drone_id}}"
_NETWORK: Final = "/v1/networks/{network_id}"

#: Its route is its own: the gateway adds the provider's key to the answer.
PROVIDER_CREATION: Final = Forwarded("POST", "/v1/providers", "registry", _OPERATOR)

FORWARDED: Final[tuple[Forwarded, ...]] = (
    Forwarded("GET", "/v1/providers", "registry", _ANY),
    Forwarded("GET", _PROVIDER, "registry", _ANY),
    Forwarded("PATCH", _PROVIDER, "registry", _FLEETS),
    Forwarded("GET", "/v1/drone-models", "registry", _ANY),
    Forwarded("GET", "/v1/drone-models/{model_id}", "registry", _ANY),
    Forwarded("PUT", "/v1/drone-models/{model_id}", "registry", _FLEETS),
    Forwarded("POST", f"{_PROVIDER}/drones", "registry", _FLEETS, timeout_s=_HEAVY_S),
    Forwarded("GET", f"{_PROVIDER}/drones", "registry", _FLEETS),
    Forwarded("GET", "/v1/drones", "registry", _OPERATOR),
    Forwarded("GET", _ONE_DRONE, "registry", _FLEETS_OR_DRONE),
    Forwarded("GET", f"{_ONE_DRONE}/telemetry", "registry", _FLEETS_OR_DRONE, is_report=True),
    Forwarded("PATCH", _ONE_DRONE, "registry", _FLEETS),
    Forwarded("DELETE", _ONE_DRONE, "registry", _FLEETS),
    Forwarded("POST", f"{_ONE_DRONE}/enrolment-tokens", "registry", _FLEETS),
    Forwarded("DELETE", f"{_ONE_DRONE}/credentials", "registry", _FLEETS),
    Forwarded("DELETE", f"{_ONE_DRONE}/learned-values", "registry", _FLEETS),
    *_batteries_and_maintenance(_PROVIDER),
    Forwarded("POST", "/v1/enrolments", "registry", ()),
    Forwarded("POST", "/v1/enrolments/rotations", "registry", _DRONE),
    Forwarded("GET", "/v1/networks", "composition", _ANY),
    Forwarded(
        "PUT", _NETWORK, "composition", _OPERATOR, limit_bytes=_NETWORK_BYTES, timeout_s=_HEAVY_S
    ),
    Forwarded("GET", _NETWORK, "composition", _ANY, timeout_s=_HEAVY_S, is_report=True),
    Forwarded("GET", f"{_NETWORK}/versions", "composition", _ANY),
    Forwarded("GET", f"{_NETWORK}/status", "composition", _ANY, is_report=True),
    Forwarded("GET", f"{_NETWORK}/weather", "composition", _ANY),
    Forwarded(
        "PUT",
        f"{_NETWORK}/weather",
        "composition",
        _OPERATOR,
        limit_bytes=_FORECAST_BYTES,
        timeout_s=_HEAVY_S,
    ),
    Forwarded("DELETE", f"{_NETWORK}/weather", "composition", _OPERATOR),
    Forwarded("GET", f"{_NETWORK}/stations", "composition", _ANY_OR_DRONE),
    Forwarded("GET", "/v1/stations/{station_id}/pads", "composition", _ANY_OR_DRONE),
    Forwarded("GET", "/v1/stations/{station_id}/reservations", "composition", _ANY),
    Forwarded(
        "POST",
        "/v1/compositions",
        "composition",
        _ANY,
        limit_bytes=_NETWORK_BYTES,
        timeout_s=_HEAVY_S,
        is_planning=True,
    ),
    Forwarded("GET", "/v1/missions", "composition", _FLEETS_OR_DRONE),
    Forwarded("GET", "/v1/missions/{mission_id}", "composition", _FLEETS_OR_DRONE),
    Forwarded("GET", "/v1/drones/{drone_id}/plans", "composition", _FLEETS, is_report=True),
    Forwarded("GET", "/v1/drones/{drone_id}/schedule", "composition", _FLEETS),
    Forwarded("GET", "/v1/stations/{station_id}/schedule", "composition", _ANY, is_report=True),
    Forwarded("GET", f"{_PROVIDER}/schedule", "composition", _FLEETS, is_report=True),
    Forwarded("POST", "/v1/missions/{mission_id}/loading", "composition", _FLEETS),
    Forwarded(
        "POST", "/v1/missions/{mission_id}/commands", "composition", _OPERATOR, has_dry_run=True
    ),
    Forwarded("GET", "/v1/closures", "composition", _ANY, is_report=True),
    *_world_rows("/v1/stations/{station_id}/closures"),
    *_world_rows("/v1/stations/{station_id}/pads/{pad}/outages"),
    *_world_rows("/v1/segments/{from_id}/{to_id}/closures"),
    *_world_rows("/v1/zones"),
    *_world_rows("/v1/ground-stops"),
    Forwarded("GET", "/v1/alarms", "composition", _FLEETS),
    Forwarded("POST", "/v1/alarms/{alarm_id}/acknowledgements", "composition", _OPERATOR),
    Forwarded("GET", "/v1/quarantine", "composition", _OPERATOR),
    Forwarded("POST", "/v1/quarantine/{quarantine_id}/replay", "composition", _OPERATOR),
    Forwarded("DELETE", "/v1/quarantine/{quarantine_id}", "composition", _OPERATOR),
    Forwarded("GET", "/v1/stats/pads", "composition", _FLEETS, is_report=True),
    Forwarded("GET", "/v1/stats/fleets", "registry", _FLEETS, is_report=True),
    Forwarded("GET", "/v1/stats/missions", "composition", _FLEETS, is_report=True),
    Forwarded("GET", "/v1/stats/drones", "composition", _FLEETS, is_report=True),
)


@dataclass(frozen=True, slots=True)
class TenantLimit:
    """The limit of a problem of customers and providers: its network may have so many stations."""

    stations: int

    def of(self, caller: Caller | None, most_bytes: int) -> int:
        """The most bytes of this caller, where operators may send `most_bytes`."""
        is_operator = caller is not None and caller.role == "operator"
        tenants_bytes = BODY_LIMIT_BYTES + self.stations * _STATION_BYTES
        return most_bytes if is_operator else min(most_bytes, tenants_bytes)


def open_calls() -> frozenset[str]:
    """The calls that need no key, as ``POST /v1/enrolments``."""
    return frozenset(f"{row.method} {row.path}" for row in FORWARDED if not row.roles)
