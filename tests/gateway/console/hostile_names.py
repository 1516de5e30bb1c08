"""Answers of a gateway in which every text that people or drones choose is markup."""

from typing import Any, Final

#: It would show an image and bold letters, and call `alert`.
MARKUP: Final = "<img src=x onerror=alert(1)><b>bold</b>"

MOMENT: Final = "2026-03-01T11:30:00Z"
DELIVERY: Final = "/v1/deliveries/dlv_1"
_PROVIDER: Final = "/v1/providers/prv_1"
DRONES: Final = f"{_PROVIDER}/drones"


def _page(*items: dict[str, Any]) -> dict[str, Any]:
    return {"items": list(items), "next_cursor": None}


_NETWORK: Final = {
    "features": [
        {
            "geometry": {"type": "Point", "coordinates": [place, 0]},
            "properties": {"kind": "station", "station_id": name, "name": MARKUP, "pads": 2},
        }
        for name, place in (("a", 0), ("b", 1))
    ]
    + [
        {
            "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0]]},
            "properties": {"kind": "segment", "from": "a", "to": "b"},
        }
    ]
}

_PACKAGE: Final = {
    "package_id": MARKUP,
    "state": "DELIVERED",
    "destination": {"station_id": "b"},
    "delivered_at": MOMENT,
    "eta_at": MOMENT,
    "promised_at": MOMENT,
    "code": "LATE",
    "detail": MARKUP,
}

_STORED_DELIVERY: Final = {
    "delivery_id": "dlv_1",
    "customer_id": MARKUP,
    "reference": MARKUP,
    "state": "IN_PROGRESS",
    "activity": None,
    "code": "DELAYED",
    "detail": MARKUP,
    "request": {"pickup": {"station_id": "a"}, "qos": {"objective": "FASTEST"}},
    "pickup": {"station_id": "a"},
    "packages": [_PACKAGE],
    "missions": [{"mission_id": "msn_1", "drone_id": "drn_1"}],
    "provider_id": "prv_1",
    "price": {"amount": 100, "currency": "USD"},
    "created_at": MOMENT,
}

_DRONE: Final = {
    "drone_id": "drn_1",
    "provider_id": "prv_1",
    "name": MARKUP,
    "registration": MARKUP,
    "model_id": MARKUP,
    "home_station_id": "a",
    "maintenance": {"flight_hours": 45.0, "cycles": 9.0, "due_since_at": None},
    "state": "ON_MISSION",
    "activity": "FLYING",
    "soc": 0.5,
    "faults": [MARKUP],
    "position": [0, 0],
    "mission_id": "msn_1",
}

_KEY: Final = {
    "key_id": "key_1",
    "role": "customer",
    "subject_id": MARKUP,
    "name": MARKUP,
    "scopes": [MARKUP],
    "created_wall_at": MOMENT,
    "expires_wall_at": MOMENT,
}

_WEBHOOK: Final = {
    "webhook_id": "whk_1",
    "url": f"https://shop.example/{MARKUP}",
    "event_types": None,
    "state": "DISABLED",
    "disabled_reason": MARKUP,
}

_WAITING_MISSION: Final = {
    "mission_id": "msn_1",
    "provider_id": "prv_1",
    "drone_id": "drn_1",
    "state": "ACTIVE",
    "start_at": MOMENT,
    "packages": [{"package_id": MARKUP}],
    "plan": {"steps": [{"kind": "PICK_UP", "station_id": "a"}, {"kind": "FLY", "load_kg": 1.0}]},
}

_ALARM: Final = {
    "alarm_id": "alm_1",
    "level": "URGENT",
    "code": "BATTERY_COLD",
    "detail": MARKUP,
    "at": MOMENT,
    "drone_id": "drn_1",
    "acknowledged_by": MARKUP,
    "acknowledged_at": MOMENT,
    "note": MARKUP,
}

_CLOSURE: Final = {
    "closure_id": "cls_1",
    "kind": "STATION",
    "station_id": "a",
    "from_at": MOMENT,
    "reason": MARKUP,
}

_SERVICE: Final = {
    "service": "gateway",
    "is_answering": True,
    "figures": [
        {"name": "skyway_queue_depth", "labels": {"queue": MARKUP}, "value": 2.0},
        {"name": "skyway_send_failures_total", "labels": {"to": MARKUP}, "value": 1.0},
    ],
    "last_errors": [
        {
            "wall_at": MOMENT,
            "level": "ERROR",
            "event": MARKUP,
            "reason": MARKUP,
            "times": 3,
            "trace_id": None,
        }
    ],
}

_TODAY: Final = {
    "from": MOMENT,
    "deliveries": 3,
    "by_state": {"COMPLETED": 2, "IN_PROGRESS": 1},
    "packages_delivered": 4,
    "on_time_share": 0.75,
    "packages_with_p90": 4,
    "p90_share": 0.9,
}

#: What the gateway answers, by path.
ANSWERS: Final[dict[str, Any]] = {
    "/v1/networks": _page({"network_id": "n"}),
    "/v1/networks/n": _NETWORK,
    "/v1/networks/n/status": {
        "status": "DEGRADED",
        "restrictions": [{"code": "STATION_CLOSED", "detail": MARKUP, "until": MOMENT}] * 6,
        "more_restrictions": 4,
    },
    "/v1/deliveries": _page(_STORED_DELIVERY),
    DELIVERY: _STORED_DELIVERY,
    f"{DELIVERY}/proof": {
        "packages": [{"package_id": MARKUP, "station_id": "b", "at": MOMENT, "mass_kg": 0.5}]
    },
    f"{DELIVERY}/tracking-link": {"tracking_url": "http://skyway.test/track/secret"},
    "/v1/audit": _page(
        {
            "entry_id": 1,
            "at": MOMENT,
            "role": "operator",
            "subject_id": MARKUP,
            "method": "POST",
            "path": "/v1/missions/msn_1/commands",
            "status": 202,
            "body": '{"reason": "<b>bold</b>"}',
        }
    ),
    "/v1/statements": _page(
        {
            "role": "customer",
            "party_id": MARKUP,
            "currency": "USD",
            "amount": 900,
            "items": {"base": 1000, "distance": 0, "correction": -100},
            "deliveries": 1,
            "lines": 2,
            "closed_at": None,
        }
    ),
    "/v1/statements/earnings": _page(
        {
            "provider_id": "prv_1",
            "currency": "USD",
            "day": "2026-03-01",
            "drone_id": None,
            "from_station_id": "a",
            "to_station_id": None,
            "deliveries": 1,
            "missions": 1,
            "amount": 900,
        }
    ),
    "/v1/statements/lines": _page(
        {
            "mission_id": "msn_1",
            "number": 1,
            "delivery_id": "dlv_1",
            "kind": "CORRECTION",
            "amount": -100,
            "currency": "USD",
            "note": MARKUP,
            "at": MOMENT,
        }
    ),
    "/v1/branding": {"name": MARKUP, "colour": "#0b6bcb"},
    "/v1/providers": _page({"provider_id": "prv_1", "name": MARKUP}),
    _PROVIDER: {"provider_id": "prv_1", "name": MARKUP, "exchanges_deliveries": True},
    f"{_PROVIDER}/exchanges": _page(
        {"delivery_id": MARKUP, "at": MOMENT, "direction": "LEFT", "reason": MARKUP}
    ),
    "/v1/providers/prv_1/schedule": _page(),
    "/v1/providers/prv_1/earnings": {
        "currency": "USD",
        "amount": 900,
        "deliveries": 2,
        "missions": 2,
        "by_day": [
            {
                "day": "2026-03-01",
                "deliveries": 2,
                "missions": 2,
                "amount": 900,
                "currency": "USD",
            }
        ],
    },
    "/v1/drones": _page(_DRONE),
    DRONES: _page(_DRONE),
    f"{DRONES}/drn_1/telemetry": {"items": [{"at": MOMENT, "position": [0, 0], "soc": 0.5}]},
    "/v1/drone-models": _page({"model_id": MARKUP, "provider_id": None}),
    "/v1/missions": _page(_WAITING_MISSION),
    "/v1/alarms": _page(_ALARM),
    "/v1/closures": _page(_CLOSURE),
    "/v1/keys": _page(_KEY),
    "/v1/webhooks": _page(_WEBHOOK),
    "/v1/webhooks/whk_1/attempts": _page(),
    "/v1/system": {"small_world": "UNAVAILABLE", "services": [_SERVICE]},
    f"{_PROVIDER}/maintenance-rules": {
        "items": [{"model_id": MARKUP, "every_flight_hours": 50.0, "every_cycles": None}]
    },
    "/v1/stats/deliveries": _TODAY | {"buckets": [_TODAY]},
    "/v1/stats/drones": {
        "total": {"flying_s": 7200.0, "recharging_s": 60.0, "missions": 3, "utilisation": 0.5}
    },
    "/v1/stats/pads": {"total": {"pads": 4, "utilisation": 0.25}},
    "/v1/ground-stops": {
        "affected_missions": [{"mission_id": "msn_1", "at": MOMENT, "delay": None}]
    },
}

#: The live picture.
PICTURE: Final[dict[str, Any]] = {
    "drones": {"drn_1": _DRONE},
    "alarms": {"alm_1": _ALARM},
    "closures": {"cls_1": _CLOSURE},
    "deliveries": {
        "dlv_1": {
            "state": "IN_PROGRESS",
            "is_waiting": True,
            "mission_ids": ["msn_1"],
            "reference": MARKUP,
            "created_at": MOMENT,
            "pickup": {"station_id": "a"},
            "packages": {MARKUP: _PACKAGE},
        }
    },
}

#: An event of the delivery.
EVENT: Final[dict[str, Any]] = {
    "event_id": "evt_1",
    "type": "delivery.delayed",
    "occurred_at": MOMENT,
    "data": {"package_id": MARKUP, "code": MARKUP, "detail": MARKUP},
}
