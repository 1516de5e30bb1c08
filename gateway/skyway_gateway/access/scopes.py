"""The scopes of API keys, the calls that each scope allows, and those that need the key itself.

Every call of customers, providers and operators is listed here once. A call that is not listed is
refused to every key with scopes.
"""

from collections.abc import Mapping
from typing import Any, Final, Literal, get_args

from skyway.runtime.errors import KeyNeeded, ScopeMissing
from skyway.runtime.http.identity import KeyHolder

Scope = Literal[
    "account:read",
    "account:write",
    "audit:read",
    "deliveries:read",
    "deliveries:write",
    "fleet:read",
    "fleet:write",
    "keys:read",
    "keys:write",
    "live:read",
    "missions:read",
    "missions:write",
    "network:read",
    "network:write",
    "operations:read",
    "operations:write",
    "quotes:write",
    "statements:read",
    "statements:write",
    "webhooks:read",
    "webhooks:write",
]

SCOPES: Final[tuple[Scope, ...]] = get_args(Scope)

_PROVIDER: Final = "/v1/providers/{provider_id}"
_DRONE: Final = f"{_PROVIDER}/drones/{{drone_id}}"
#: What operators close or restrict, and everybody may see.
_CLOSURES: Final = (
    "/v1/stations/{station_id}/closures",
    "/v1/stations/{station_id}/pads/{pad}/outages",
    "/v1/segments/{from_id}/{to_id}/closures",
    "/v1/zones",
    "/v1/ground-stops",
)

#: The calls that each scope allows, as ``GET /v1/clock``.
CALLS: Final[Mapping[Scope, tuple[str, ...]]] = {
    "account:read": (
        "GET /v1/branding",
        "GET /v1/clock",
        "GET /v1/limits",
        "GET /v1/sessions/current",
    ),
    "account:write": (
        "PUT /v1/branding",
        "POST /v1/keys/rotations",
        "POST /v1/session-links",
        "POST /v1/sessions",
        "DELETE /v1/sessions/current",
    ),
    "audit:read": ("GET /v1/audit",),
    "deliveries:read": (
        "GET /v1/deliveries",
        "GET /v1/deliveries/{delivery_id}",
        "GET /v1/deliveries/{delivery_id}/events",
        "GET /v1/deliveries/{delivery_id}/packages/{package_id}/proof",
        "GET /v1/deliveries/{delivery_id}/packages/{package_id}/proof/picture",
        "GET /v1/deliveries/{delivery_id}/plan",
        "GET /v1/deliveries/{delivery_id}/proof",
        "GET /v1/deliveries/{delivery_id}/track",
        "GET /v1/deliveries/{delivery_id}/tracking-link",
        f"GET {_PROVIDER}/deliveries",
        f"GET {_PROVIDER}/earnings",
        f"GET {_PROVIDER}/exchanges",
        "GET /v1/stats/deliveries",
        "GET /v1/stats/promises",
    ),
    "deliveries:write": (
        "POST /v1/deliveries",
        "PATCH /v1/deliveries/{delivery_id}",
        "DELETE /v1/deliveries/{delivery_id}/personal-data",
        "POST /v1/deliveries/{delivery_id}/cancel",
        "POST /v1/deliveries/{delivery_id}/packages/{package_id}/proof",
        "POST /v1/deliveries/{delivery_id}/tracking-link",
        "DELETE /v1/deliveries/{delivery_id}/tracking-link",
    ),
    "fleet:read": (
        "GET /v1/providers",
        f"GET {_PROVIDER}",
        f"GET {_PROVIDER}/drones",
        "GET /v1/drones",
        f"GET {_DRONE}",
        f"GET {_DRONE}/telemetry",
        f"GET {_PROVIDER}/batteries",
        f"GET {_PROVIDER}/batteries/{{battery_id}}",
        f"GET {_PROVIDER}/maintenance-rules",
        "GET /v1/drone-models",
        "GET /v1/drone-models/{model_id}",
        "GET /v1/stats/fleets",
    ),
    "fleet:write": (
        "POST /v1/providers",
        f"PATCH {_PROVIDER}",
        f"POST {_PROVIDER}/drones",
        f"PATCH {_DRONE}",
        f"DELETE {_DRONE}",
        f"POST {_DRONE}/enrolment-tokens",
        f"DELETE {_DRONE}/credentials",
        f"DELETE {_DRONE}/learned-values",
        f"PUT {_DRONE}/battery",
        f"DELETE {_DRONE}/battery",
        f"POST {_DRONE}/maintenance",
        f"POST {_PROVIDER}/batteries",
        f"DELETE {_PROVIDER}/batteries/{{battery_id}}",
        f"PUT {_PROVIDER}/maintenance-rules/{{model_id}}",
        f"DELETE {_PROVIDER}/maintenance-rules/{{model_id}}",
        "PUT /v1/drone-models/{model_id}",
    ),
    "keys:read": ("GET /v1/keys", "GET /v1/keys/{key_id}"),
    "keys:write": ("POST /v1/keys", "DELETE /v1/keys/{key_id}"),
    "live:read": ("GET /v1/live",),
    "missions:read": (
        "GET /v1/missions",
        "GET /v1/missions/{mission_id}",
        "GET /v1/drones/{drone_id}/plans",
        "GET /v1/drones/{drone_id}/schedule",
        f"GET {_PROVIDER}/schedule",
        "GET /v1/stats/missions",
        "GET /v1/stats/drones",
    ),
    "missions:write": (
        "POST /v1/missions/{mission_id}/commands",
        "POST /v1/missions/{mission_id}/loading",
    ),
    "network:read": (
        "GET /v1/networks",
        "GET /v1/networks/{network_id}",
        "GET /v1/networks/{network_id}/stations",
        "GET /v1/networks/{network_id}/status",
        "GET /v1/networks/{network_id}/versions",
        "GET /v1/networks/{network_id}/weather",
        "GET /v1/stations/{station_id}/pads",
        "GET /v1/stations/{station_id}/reservations",
        "GET /v1/stations/{station_id}/schedule",
        "GET /v1/stats/pads",
        "GET /v1/closures",
        *(f"GET {path}" for path in _CLOSURES),
    ),
    "network:write": (
        "PUT /v1/networks/{network_id}",
        "PUT /v1/networks/{network_id}/weather",
        "DELETE /v1/networks/{network_id}/weather",
        *(f"POST {path}" for path in _CLOSURES),
        *(f"DELETE {path}/{{closure_id}}" for path in _CLOSURES),
    ),
    "operations:read": (
        "GET /v1/alarms",
        "GET /v1/quarantine",
        "GET /v1/system",
    ),
    "operations:write": (
        "POST /v1/alarms/{alarm_id}/acknowledgements",
        "POST /v1/quarantine/{quarantine_id}/replay",
        "DELETE /v1/quarantine/{quarantine_id}",
        "POST /v1/small-world",
    ),
    "quotes:write": (
        "POST /v1/quotes",
        "GET /v1/quotes/{quote_id}",
        "GET /v1/places",
        "POST /v1/compositions",
    ),
    "statements:read": (
        "GET /v1/statements",
        "GET /v1/statements/earnings",
        "GET /v1/statements/lines",
    ),
    "statements:write": ("POST /v1/statements/lines",),
    "webhooks:read": (
        "GET /v1/webhooks",
        "GET /v1/webhooks/{webhook_id}",
        "GET /v1/webhooks/{webhook_id}/attempts",
    ),
    "webhooks:write": (
        "POST /v1/webhooks",
        "PATCH /v1/webhooks/{webhook_id}",
        "DELETE /v1/webhooks/{webhook_id}",
        "POST /v1/webhooks/{webhook_id}/test",
        "POST /v1/webhooks/{webhook_id}/replay",
        "POST /v1/webhooks/{webhook_id}/secret-rotations",
    ),
}

#: The calls that a browser's session may not make, because their answer holds a secret, or their
#: effect is a right, that outlives the session: the key itself must be shown.
NEEDS_KEY: Final = frozenset(
    {
        # Keys, and what begins a session.
        "POST /v1/keys",
        "POST /v1/keys/rotations",
        "POST /v1/providers",
        "POST /v1/session-links",
        # What a drone logs in with.
        f"POST {_PROVIDER}/drones",
        f"POST {_DRONE}/enrolment-tokens",
        # What follows deliveries without a key.
        "GET /v1/deliveries/{delivery_id}/tracking-link",
        "POST /v1/deliveries/{delivery_id}/tracking-link",
        "POST /v1/webhooks",
        "PATCH /v1/webhooks/{webhook_id}",
        "POST /v1/webhooks/{webhook_id}/secret-rotations",
    }
)

_SCOPE_OF: Final = {call: scope for scope, calls in CALLS.items() for call in calls}


def require_scope(holder: KeyHolder, call: str) -> None:
    """Go on only if the key has the scope of this call; a key without scopes has all of them.

    Raises
    ------
    KeyNeeded
        A browser's session makes a call that needs the key itself.
    ScopeMissing
        The key has scopes, and the scope of this call is not one of them.
    """
    if holder.is_session and call in NEEDS_KEY:
        raise KeyNeeded
    if holder.scopes is None:
        return
    needed = _SCOPE_OF.get(call)
    if needed is None or needed not in holder.scopes:
        raise ScopeMissing(needed or "of all calls")


def with_scopes(document: dict[str, Any]) -> dict[str, Any]:  # a JSON document
    """The OpenAPI document in which each call names its scope."""
    paths = {
        path: {
            method: _with_scope(f"{method.upper()} {path}", operation)
            for method, operation in operations.items()
        }
        for path, operations in document["paths"].items()
    }
    return {**document, "paths": paths}


def _with_scope(call: str, operation: dict[str, Any]) -> dict[str, Any]:
    scope = _SCOPE_OF.get(call)
    if scope is None:
        return operation
    # OpenAPI 3.1 lets a bearer scheme name the scopes that a call needs.
    security = [{name: [scope] for name in scheme} for scheme in operation["security"]]
    about = f"{operation['description']}\n\nScope: `{scope}`."
    if call in NEEDS_KEY:
        about += " A browser's session is refused with KEY_NEEDED."
    return {**operation, "description": about, "security": security}
