"""Every public call that is not the gateway's own: path, service, roles. Nothing else is passed."""

from typing import Final

from skyway.runtime.http.identity import CallerRole
from skyway_gateway.forward.call import Forwarded

_ANY: Final[tuple[CallerRole, ...]] = ("customer", "provider", "operator")
_ANY_OR_DRONE: Final[tuple[CallerRole, ...]] = (*_ANY, "drone")
_FLEETS: Final[tuple[CallerRole, ...]] = ("provider", "operator")
_FLEETS_OR_DRONE: Final[tuple[CallerRole, ...]] = (*_FLEETS, "drone")
_DRONE: Final[tuple[CallerRole, ...]] = ("drone",)
_OPERATOR: Final[tuple[CallerRole, ...]] = ("operator",)

#: Bytes and wall seconds for what is large or heavy (docs/reference/rest.md).
_NETWORK_BYTES: Final = 256 * 1024 * 1024
_FLEET_BYTES: Final = 8 * 1024 * 1024
_HEAVY_S: Final = 180.0

_GEOJSON: Final = "application/geo+json"


def _world_rows(path: str, what: str) -> tuple[Forwarded, ...]:
    """What operators make and lift in the world, and everybody may see."""
    return (
        Forwarded(
            "POST",
            path,
            "composition",
            _OPERATOR,
            f"Make a {what}, or with ?dry_run=true show which missions it would hit",
            statuses=(201, 200),
        ),
        Forwarded("GET", path, "composition", _ANY, f"List each {what} that is in force"),
        Forwarded(
            "DELETE",
            f"{path}/{{closure_id}}",
            "composition",
            _OPERATOR,
            f"Lift a {what}",
            statuses=(204,),
        ),
    )


#: `POST /v1/providers` is not here: `access` adds the provider's key to its answer.
FORWARDED: Final[tuple[Forwarded, ...]] = (
    Forwarded("GET", "/v1/providers", "registry", _ANY, "List providers"),
    Forwarded("GET", "/v1/providers/{provider_id}", "registry", _ANY, "Show a provider"),
    Forwarded("PATCH", "/v1/providers/{provider_id}", "registry", _FLEETS, "Change a provider"),
    Forwarded("GET", "/v1/drone-models", "registry", _ANY, "List drone models"),
    Forwarded("GET", "/v1/drone-models/{model_id}", "registry", _ANY, "Show a drone model"),
    Forwarded(
        "PUT",
        "/v1/drone-models/{model_id}",
        "registry",
        _OPERATOR,
        "Set a drone model",
        statuses=(200, 201),
    ),
    Forwarded(
        "POST",
        "/v1/providers/{provider_id}/drones",
        "registry",
        _FLEETS,
        "Register one drone, or a list of them",
        statuses=(201,),
        limit_bytes=_FLEET_BYTES,
        timeout_s=_HEAVY_S,
    ),
    Forwarded(
        "GET", "/v1/providers/{provider_id}/drones", "registry", _FLEETS, "List a fleet's drones"
    ),
    Forwarded(
        "GET",
        "/v1/providers/{provider_id}/drones/{drone_id}",
        "registry",
        _FLEETS_OR_DRONE,
        "Show a drone",
    ),
    Forwarded(
        "GET",
        "/v1/providers/{provider_id}/drones/{drone_id}/telemetry",
        "registry",
        _FLEETS_OR_DRONE,
        "Show what a drone measured: samples or minutes, JSON or ?format=geojson",
        media_types=("application/json", _GEOJSON),
    ),
    Forwarded(
        "PATCH",
        "/v1/providers/{provider_id}/drones/{drone_id}",
        "registry",
        _FLEETS,
        "Change a drone",
    ),
    Forwarded(
        "DELETE",
        "/v1/providers/{provider_id}/drones/{drone_id}",
        "registry",
        _FLEETS,
        "Remove a drone",
        statuses=(204,),
    ),
    Forwarded(
        "POST",
        "/v1/providers/{provider_id}/drones/{drone_id}/enrolment-tokens",
        "registry",
        _FLEETS,
        "Make another enrolment token for a drone",
        statuses=(201,),
    ),
    Forwarded(
        "DELETE",
        "/v1/providers/{provider_id}/drones/{drone_id}/credentials",
        "registry",
        _FLEETS,
        "Cut a drone off: its password and key stop at once",
        statuses=(204,),
    ),
    Forwarded(
        "POST",
        "/v1/enrolments",
        "registry",
        (),
        "Exchange an enrolment token, once, for a drone's credentials; no bearer",
        statuses=(201,),
    ),
    Forwarded(
        "POST",
        "/v1/enrolments/rotations",
        "registry",
        _DRONE,
        "New credentials for the calling drone; the old ones stop when the new key is first used",
        statuses=(201,),
    ),
    Forwarded("GET", "/v1/networks", "composition", _ANY, "List skyway networks"),
    Forwarded(
        "PUT",
        "/v1/networks/{network_id}",
        "composition",
        _OPERATOR,
        "Publish a skyway network (GeoJSON)",
        statuses=(200, 201),
        limit_bytes=_NETWORK_BYTES,
        timeout_s=_HEAVY_S,
    ),
    Forwarded(
        "GET",
        "/v1/networks/{network_id}",
        "composition",
        _ANY,
        "Show a skyway network (GeoJSON)",
        media_types=(_GEOJSON,),
        timeout_s=_HEAVY_S,
    ),
    Forwarded(
        "GET", "/v1/networks/{network_id}/versions", "composition", _ANY, "List its versions"
    ),
    Forwarded(
        "GET",
        "/v1/networks/{network_id}/stations",
        "composition",
        _ANY_OR_DRONE,
        "List its stations, or those around a point",
    ),
    Forwarded(
        "GET", "/v1/networks/{network_id}/segments", "composition", _ANY, "List its segments"
    ),
    Forwarded("GET", "/v1/networks/{network_id}/zones", "composition", _ANY, "List its zones"),
    Forwarded(
        "GET",
        "/v1/stations/{station_id}/pads",
        "composition",
        _ANY_OR_DRONE,
        "Show who holds which pad",
    ),
    Forwarded(
        "GET",
        "/v1/stations/{station_id}/reservations",
        "composition",
        _ANY,
        "List a station's reservations",
    ),
    Forwarded(
        "POST",
        "/v1/compositions",
        "composition",
        _ANY,
        "Compose a plan, without side effect",
        limit_bytes=_NETWORK_BYTES,
        timeout_s=_HEAVY_S,
    ),
    Forwarded("GET", "/v1/missions", "composition", _FLEETS_OR_DRONE, "List missions"),
    Forwarded(
        "GET",
        "/v1/missions/{mission_id}",
        "composition",
        _FLEETS_OR_DRONE,
        "Show a mission's progress",
    ),
    Forwarded(
        "POST",
        "/v1/missions/{mission_id}/loading",
        "composition",
        _FLEETS,
        "Confirm what is loaded, with measured masses",
    ),
    Forwarded(
        "POST",
        "/v1/missions/{mission_id}/commands",
        "composition",
        _OPERATOR,
        "Hold, resume, divert, call home or cancel a mission",
        statuses=(202,),
    ),
    *_world_rows("/v1/stations/{station_id}/closures", "station closure"),
    *_world_rows("/v1/stations/{station_id}/pads/{pad}/outages", "pad outage"),
    *_world_rows("/v1/segments/{from_id}/{to_id}/closures", "segment closure"),
    *_world_rows("/v1/zones", "zone"),
    *_world_rows("/v1/ground-stops", "ground stop"),
    Forwarded("GET", "/v1/alarms", "composition", _FLEETS, "List alarms"),
    Forwarded(
        "POST",
        "/v1/alarms/{alarm_id}/acknowledgements",
        "composition",
        _OPERATOR,
        "Acknowledge an alarm",
    ),
    Forwarded(
        "GET", "/v1/stats/pads", "composition", _FLEETS, "How much of the time pads are taken"
    ),
    Forwarded(
        "GET", "/v1/stats/fleets", "registry", _FLEETS, "How many drones are in which state now"
    ),
    Forwarded(
        "GET", "/v1/stats/missions", "composition", _FLEETS, "How many missions are under way now"
    ),
    Forwarded("GET", "/v1/stats/drones", "composition", _FLEETS, "What drones spend their time on"),
)


def larger_bodies() -> dict[str, int]:
    """The calls whose bodies may be larger than usual, as ``PUT /v1/networks/{network_id}``."""
    return {
        f"{row.method} {row.path}": row.limit_bytes
        for row in FORWARDED
        if row.limit_bytes is not None
    }
