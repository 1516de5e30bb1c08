"""Corruptions of values that once stood in one place only: each has a bound or a copy now."""

from typing import Final

from tests.verification.damaged_copies import Corruption
from tests.verification.newer_access_corruptions import ACCESS_AND_SIGNING, in_future

_HOUR_MS: Final = 3_600_000
_DAY_MS: Final = 24 * _HOUR_MS
_PROMISE: Final = "a package has the promise that its customer was notified of"
_WALL: Final = "what is stored as past is past, by wall time"
_FLEET: Final = "what is stored as past is past, by fleet time"
_NETWORK: Final = "the gateway knows no later version of a network, and no other stations"
_HOLD: Final = "a hold is of the customer whose offers it keeps"
_PLANNED_WITH: Final = "composition plans with the promise that the gateway made"
_RENEWED: Final = "composition counts no later renewal of a drone's credentials than the registry"
_BEGAN: Final = "a delivery began as its first event says, and waits and ends later"
_FLEW: Final = "a mission flew as long as the drone's evidence says"
_FORECAST: Final = "a forecast can be read, is not from the future, and its content has its hash"
_LEARNED: Final = "what was learned about a drone follows its states"
_MINUTE: Final = "a minute of telemetry has samples, and means between the least and the greatest"
_ALARM: Final = "an alarm is acknowledged by somebody, after it was raised"
_SENT: Final = "I4 a mission's steps are those that were sent"
_LATER_PLAN: Final = (
    "I12 a mission was planned with no later version or condition than its network has"
)
_ATTEMPT: Final = (
    "an attempt at a webhook is about its event, and is tried again as its outcome says"
)
_FLYING: Final = " WHERE delivery_id = :flying AND package_id = 'p2'"


def _cut(seq: int = 3) -> str:
    """SQL that invents a cut step that says what its event says."""
    return (
        f"INSERT INTO cut_steps SELECT mission_id, {seq}, step_id, kind, station_id, started_ms,"
        f" ended_ms, json_set(event, '$.seq', {seq}) FROM mission_steps"
        " WHERE mission_id = :flying_mission AND step_id = 2"
    )


def _minute(*, soc: float = 0.5, samples: int = 1, power_w: float = 5.0) -> str:
    return (
        "INSERT INTO telemetry_minutes VALUES (:flying_drone, 60000, 1, -97.0, 29.0,"
        f" {samples}, {soc}, 0.4, 0.6, {power_w}, 4.0, 6.0, 1.0, 1.0, 1.0)"
    )


_ALARMED: Final = (
    "INSERT INTO alarms (alarm_id, level, code, detail, at_ms, provider_id, mission_id, data,"
    " acknowledged_ms, acknowledged_by) SELECT 'alm_1', 'WARNING', 'X', 'x', 5, {provider},"
    " mission_id, '{{}}', {at}, {by} FROM missions WHERE mission_id = :flying_mission"
)

_PROMISES: Final = (
    Corruption(
        "a promise moved by an hour, with what follows from it",
        _PROMISE,
        gateway=f"UPDATE packages SET promised_ms = promised_ms + {_HOUR_MS},"
        f" due_ms = due_ms + {_HOUR_MS}" + _FLYING,
    ),
    Corruption(
        "a promise of a delivered package moved by three days",
        _PROMISE,
        gateway=f"UPDATE packages SET promised_ms = promised_ms - {3 * _DAY_MS},"
        f" due_ms = due_ms - {3 * _DAY_MS} WHERE delivery_id = :completed",
    ),
    Corruption(
        "a promise moved by two milliseconds",
        _PROMISE,
        gateway="UPDATE packages SET promised_ms = promised_ms + 2, due_ms = due_ms + 2" + _FLYING,
    ),
    Corruption(
        "a P90 that nobody was notified of",
        _PROMISE,
        gateway=f"UPDATE packages SET promised_p90_ms = promised_ms + {_HOUR_MS}" + _FLYING,
    ),
    Corruption(
        "a promise forgotten",
        _PROMISE,
        gateway="UPDATE packages SET promised_ms = NULL, due_ms = NULL" + _FLYING,
    ),
    Corruption(
        "a due moment forgotten",
        _PROMISE,
        gateway="UPDATE packages SET due_ms = NULL" + _FLYING,
    ),
    Corruption(
        "a QUEUED mission planned with a promise of an hour later",
        _PLANNED_WITH,
        composition="UPDATE missions SET promised = replace(promised, json_extract(promised,"
        " '$[0].eta_at'), '2030-01-01T00:00:00Z') WHERE mission_id = :queued_behind_mission",
    ),
    Corruption(
        "a hold of another customer",
        _HOLD,
        composition="UPDATE offer_holds SET customer_id = 'thief'",
    ),
    Corruption(
        "a held quote of another customer",
        _HOLD,
        gateway="UPDATE quotes SET customer_id = 'thief' WHERE hold_id IS NOT NULL",
    ),
    Corruption(
        "a quote that can be accepted for a month",
        "a quote can be accepted for a day at most",
        gateway=f"UPDATE quotes SET expires_wall_ms = expires_wall_ms + {30 * _DAY_MS}",
    ),
    Corruption(
        "a quote made next year",
        _FLEET,
        gateway=in_future("quotes", "made_ms"),
    ),
)

_DELIVERIES: Final = (
    Corruption(
        "time on pads without a recharge in what was known of a mission",
        "what was known when a mission was promised fits together",
        gateway="UPDATE missions SET promised_on = '{\"recharging_share\": 0.5}'"
        " WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a delivery requested an hour earlier",
        _BEGAN,
        gateway=f"UPDATE deliveries SET created_ms = created_ms - {_HOUR_MS}"
        " WHERE delivery_id = :completed",
    ),
    Corruption(
        "a delivery changed before it was requested",
        _BEGAN,
        gateway="UPDATE deliveries SET updated_ms = 5 WHERE delivery_id = :completed",
    ),
    Corruption(
        "a delivery that waits since before it was requested",
        _BEGAN,
        gateway="UPDATE deliveries SET waits_since_ms = 5 WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a pickup that nobody asked for",
        _BEGAN,
        gateway="UPDATE deliveries SET earliest_pickup_ms = 5 WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a request that asks for another objective",
        _BEGAN,
        gateway="UPDATE deliveries SET request = json_set(request, '$.qos.objective', 'CHEAPEST')"
        " WHERE delivery_id = :flying",
    ),
    Corruption(
        "a delivery changed next year",
        _FLEET,
        gateway=in_future("deliveries", "updated_ms"),
    ),
    Corruption(
        "a delivery woken next year",
        _WALL,
        gateway=in_future("deliveries", "woken_wall_ms", "WHERE delivery_id = :waiting"),
    ),
    Corruption(
        "a mission that flew longer",
        _FLEW,
        gateway="UPDATE missions SET flight_s = flight_s + 1 WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "the waiting of a mission forgotten",
        _FLEW,
        gateway="UPDATE missions SET waiting_s = NULL WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a mission that ended next year",
        _FLEET,
        gateway=in_future("missions", "ended_ms", "WHERE mission_id = :completed_mission"),
    ),
    Corruption(
        "a webhook given to another customer",
        "I13 a webhook is notified of deliveries of its own customer",
        gateway="UPDATE webhooks SET customer_id = 'thief' WHERE webhook_id = :webhook",
    ),
    Corruption(
        "a delivery given to another customer, with its notifications",
        "I13 a webhook is notified of deliveries of its own customer",
        gateway="UPDATE deliveries SET customer_id = 'thief' WHERE delivery_id = :flying",
    ),
    Corruption(
        "a webhook changed before it was made",
        "a webhook says why it is disabled, and when it changed",
        gateway="UPDATE webhooks SET changed_wall_ms = 5 WHERE webhook_id = :webhook",
    ),
    Corruption(
        "an active webhook that says why it is disabled",
        "a webhook says why it is disabled, and when it changed",
        gateway="UPDATE webhooks SET disabled_reason = 'x' WHERE webhook_id = :webhook",
    ),
    Corruption(
        "a webhook changed next year, so that it need not be notified",
        _WALL,
        gateway=in_future("webhooks", "changed_wall_ms", "WHERE webhook_id = :webhook"),
    ),
    Corruption(
        "an attempt with another type of event",
        _ATTEMPT,
        gateway="UPDATE webhook_attempts SET event_type = 'delivery.lost'",
    ),
    Corruption(
        "an attempt that took less than no time",
        _ATTEMPT,
        gateway="UPDATE webhook_attempts SET duration_ms = -1",
    ),
    Corruption(
        "attempts that count as deleted by their age next year",
        _WALL,
        gateway="INSERT INTO pruned VALUES ('webhook_attempts', 1900000000000)",
    ),
    Corruption(
        "a stored answer that stays for a year",
        _FLEET,
        gateway=in_future("idempotency", "created_at_ms"),
    ),
)

_SHARED: Final = (
    Corruption(
        "a known network ahead of its network",
        _NETWORK,
        gateway="UPDATE known_networks SET version = version + 1",
    ),
    Corruption(
        "a known network ahead in its text only",
        _NETWORK,
        gateway="UPDATE known_networks SET stations = json_set(stations, '$.version', 9)",
    ),
    Corruption(
        "a known station moved",
        _NETWORK,
        gateway="UPDATE known_networks SET stations = replace(stations, '-97.64', '-97.65')",
    ),
    Corruption(
        "a renewal that the registry has not noted",
        _RENEWED,
        composition="UPDATE drone_links SET renewed_ms = 9 WHERE drone_id = :flying_drone",
        registry="INSERT OR REPLACE INTO renewals VALUES (:flying_drone, 5, 5, 1)",
    ),
    *(
        Corruption(
            f"a replica of the {service} from next year",
            _WALL,
            **{service: "INSERT INTO replicas VALUES ('x', 1900000000000, 1900000000000, 1)"},
        )
        for service in ("gateway", "composition", "registry")
    ),
)

_COMPOSITION: Final = (
    Corruption(
        "a cut step deleted",
        "a mission counts its cut steps",
        composition="UPDATE missions SET cuts = 1 WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a cut step invented",
        "a mission counts its cut steps",
        composition=_cut(),
    ),
    Corruption(
        "the first step of a mission deleted",
        _SENT,
        composition="DELETE FROM mission_steps WHERE mission_id = :flying_mission AND step_id = 1",
    ),
    Corruption(
        "a forecast received next year",
        _FORECAST,
        composition=in_future("forecasts", "received_ms"),
    ),
    Corruption(
        "a forecast received before it was issued",
        _FORECAST,
        composition=f"UPDATE forecasts SET received_ms = received_ms - {_DAY_MS}",
    ),
    Corruption(
        "a wind measured next year",
        _FORECAST,
        composition="UPDATE forecasts SET measured = json_object('at', '2090-01-01T00:00:00Z',"
        " 'places', json('[]'))",
    ),
    Corruption(
        "a mission planned with a later version",
        _LATER_PLAN,
        composition="UPDATE missions SET planned_version = 99 WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a mission planned with a later condition",
        _LATER_PLAN,
        composition="UPDATE missions SET planned_conditions = 99"
        " WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a mission that expires a day later",
        "a mission's first instruction expires when the mission says",
        composition=f"UPDATE missions SET expires_ms = expires_ms + {_DAY_MS}"
        " WHERE mission_id = :booked_mission",
    ),
    Corruption(
        "a mission loaded in another way",
        "a mission's columns say what its body says",
        composition="UPDATE missions SET loading = 'CONFIRMED' WHERE mission_id = :booked_mission",
    ),
    Corruption(
        "a mission that others may join elsewhere",
        "a mission's columns say what its body says",
        composition="UPDATE missions SET pooling_at = 'line-s2'"
        " WHERE mission_id = :queued_behind_mission",
    ),
    Corruption(
        "an alarm acknowledged by nobody",
        _ALARM,
        composition=_ALARMED.format(provider="provider_id", at="6", by="NULL"),
    ),
    Corruption(
        "an alarm acknowledged before it was raised",
        _ALARM,
        composition=_ALARMED.format(provider="provider_id", at="4", by="'op'"),
    ),
    Corruption(
        "an alarm about another provider",
        "an alarm of a mission is about its provider",
        composition=_ALARMED.format(provider="'prv_other'", at="NULL", by="NULL"),
    ),
    Corruption(
        "a package handed over next year",
        "I6 a drone has had or handed over its packages in the past",
        composition=in_future("custody", "at_ms", "WHERE delivery_id = :completed AND seq = 3"),
    ),
    Corruption(
        "a step ended next year",
        _FLEET,
        composition=in_future("mission_steps", "ended_ms", "WHERE status = 'ENDED'"),
    ),
    Corruption(
        "a network published next year",
        _FLEET,
        composition=in_future("networks", "published_ms"),
    ),
    Corruption(
        "a closure made next year",
        _FLEET,
        composition=in_future("closures", "made_ms"),
    ),
    Corruption(
        "a link asked for its events next year",
        _WALL,
        composition=in_future("drone_links", "report_asked_wall_ms"),
    ),
)

_PROOFS: Final = (
    Corruption(
        "a delivered package whose proof nobody gave",
        "I6 a package that asks for a proof is delivered only with one",
        composition="UPDATE missions SET request = json_set(request,"
        """ '$.packages[0].dropoff_verification', json('{"method":"PIN"}'))"""
        " WHERE delivery_id = :completed",
    ),
    Corruption(
        "a proof for which no step waits",
        "I6 a proof is one that its step awaits",
        composition="INSERT INTO proofs SELECT mission_id, 1, 'p1', delivery_id, 'p1', 'PIN', 1,"
        " NULL, 0 FROM missions WHERE mission_id = :flying_mission",
    ),
)

_REGISTRY: Final = (
    Corruption(
        "learned from a later state than was seen",
        _LEARNED,
        registry="UPDATE learned_values SET learned_seq = learned_seq + 100000",
    ),
    Corruption(
        "learned from a session that never was",
        _LEARNED,
        registry="UPDATE learned_values SET learned_session = learned_session + 100000",
    ),
    Corruption(
        "learned next year",
        _FLEET,
        registry=in_future("learned_values", "learned_ms"),
    ),
    Corruption(
        "a drone seen next year",
        _WALL,
        registry=in_future("presence", "last_seen_wall_ms"),
    ),
    Corruption(
        "a sample heard next year",
        _WALL,
        registry=in_future("telemetry_samples", "heard_wall_ms"),
    ),
    Corruption(
        "a drone maintained next year",
        _FLEET,
        registry=in_future("drones", "maintained_ms", "WHERE drone_id = :silent_drone"),
    ),
    Corruption(
        "a hint reported next year",
        _WALL,
        registry=in_future("mission_hints", "reported_wall_ms"),
    ),
    Corruption("a minute without samples", _MINUTE, registry=_minute(samples=0)),
    Corruption("a minute with a mean above all its samples", _MINUTE, registry=_minute(soc=0.7)),
    Corruption("a minute with a mean below its samples", _MINUTE, registry=_minute(power_w=1.0)),
    Corruption(
        "a waiting alarm about another drone",
        "a waiting alarm is about its drone",
        registry="INSERT INTO waiting_alarms SELECT :flying_drone, json_object('schema_version', 1,"
        " 'provider_id', provider_id, 'drone_id', 'drn_other', 'level', 'WARNING', 'code', 'X',"
        " 'detail', 'x', 'at', '2026-03-01T12:00:00Z') FROM drones WHERE drone_id = :flying_drone",
    ),
)

_TEST_MODE: Final = (
    Corruption(
        "a live delivery given to a test account",
        "a delivery's id says whether its customer is a test account",
        gateway="UPDATE deliveries SET customer_id = 'test_thief' WHERE delivery_id = :completed",
    ),
    Corruption(
        "a live delivery that the sandbox plays",
        "a test delivery has the reports of its own missions, in order",
        gateway="INSERT INTO sandbox_missions SELECT 'msn_1', delivery_id, 1, '{}', '[]', 0, NULL"
        " FROM deliveries WHERE delivery_id = :completed",
    ),
    Corruption(
        "a test delivery that composition knows",
        "composition knows no test delivery",
        composition="INSERT INTO deliveries (delivery_id) VALUES ('dlv_test_1')",
    ),
)

NEWER_CORRUPTIONS: Final = (
    *_PROMISES,
    *_DELIVERIES,
    *ACCESS_AND_SIGNING,
    *_SHARED,
    *_COMPOSITION,
    *_PROOFS,
    *_TEST_MODE,
    *_REGISTRY,
)
