"""Corruptions of the registry's database, and of what two services know of the same thing."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_REGISTERED: Final = "the drone of a live mission is registered"
_FREE: Final = "a hint says when, where and with what charge its drone is free, or nothing"
_CHANGES: Final = "the change numbers are not behind the changes"

_REGISTRY: Final = (
    Corruption(
        "a state of a drone at the end of the calendar",
        "every moment and number is one that Skyway writes",
        registry="UPDATE presence SET state_at_ms = 253402300800000 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a charge that is infinite",
        "every moment and number is one that Skyway writes",
        registry="UPDATE presence SET soc = 9e999 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "an index of the registry dropped",
        "every index and trigger of the newest migration exists",
        registry="DROP INDEX mission_hints_by_drone",
    ),
    Corruption(
        "a provider deleted with its drones left",
        "every row that is referred to exists",
        registry="DELETE FROM providers WHERE name = 'Flying Air'",
    ),
    Corruption(
        "a tariff below zero",
        "every stored text has its form",
        registry="UPDATE providers SET tariff = json_set(tariff, '$.base', -100)",
    ),
    Corruption(
        "the broker account of a drone deleted",
        "every drone has a broker account",
        registry="DELETE FROM broker_accounts WHERE user_name = :flying_drone",
    ),
    Corruption(
        "a broker account without a drone",
        "every drone's broker account has a drone",
        registry="UPDATE broker_accounts SET user_name = 'drn_gone'"
        " WHERE user_name = :silent_drone",
    ),
    Corruption(
        "the password of a broker account cut",
        "every stored text has its form",
        registry="UPDATE broker_accounts SET password_hash = substr(password_hash, 1, 20)"
        " WHERE user_name = :flying_drone",
    ),
    Corruption(
        "the hash of an enrolment token cut",
        "every stored text has its form",
        registry="UPDATE enrolment_tokens SET token_hash = substr(token_hash, 1, 20)"
        " WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "the certificate of a key in use revoked",
        "no certificate is revoked whose key is in use",
        registry="INSERT INTO drone_keys (drone_id, key_hash)"
        " SELECT drone_id, replace(hex(zeroblob(32)), '0', 'a') FROM drones"
        " WHERE drone_id = :flying_drone AND drone_id NOT IN (SELECT drone_id FROM drone_keys);"
        " INSERT INTO revoked_certificates (key_hash, user_name, ends_wall_ms)"
        " SELECT key_hash, 'prv_1/drn_1', 1893456000000 FROM drone_keys"
        " WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "the presence of a drone deleted",
        "every drone has one presence",
        registry="DELETE FROM presence WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a presence without its drone",
        "every presence has a drone",
        registry="DELETE FROM drones WHERE drone_id = :silent_drone",
    ),
    Corruption(
        "a model that nobody knows",
        "every drone has an existing model",
        registry="UPDATE drones SET model_id = 'pigeon' WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a drone of a model that another provider has for itself",
        "a drone's model is its provider's own or in the catalogue",
        registry="INSERT INTO drone_models SELECT model_id, '{}', 'prv_other' FROM drones"
        " WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a charge above full",
        "a drone's charge and place are possible",
        registry="UPDATE presence SET soc = 7.5 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a drone outside the world",
        "a drone's charge and place are possible",
        registry="UPDATE presence SET latitude_deg = 123.0 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a home outside the world",
        "a drone's home is on earth, and its first charge possible",
        registry="UPDATE drones SET home_latitude_deg = 123.0 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "an endless number in a sample",
        "a sample of telemetry is possible",
        registry="UPDATE telemetry_samples SET power_w = 9e999",
    ),
    Corruption(
        "a charge below zero in a sample",
        "a sample of telemetry is possible",
        registry="UPDATE telemetry_samples SET soc = -0.5",
    ),
    Corruption(
        "a dead hint of a live mission",
        "a hint is live while its mission is",
        registry="UPDATE mission_hints SET is_live = 0 WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a live hint of a QUEUED mission",
        "a hint is live while its mission is",
        registry="UPDATE mission_hints SET is_live = 1 WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a drone that is free at no station",
        _FREE,
        registry="UPDATE mission_hints SET free_station_id = NULL"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a drone that is free at no time",
        _FREE,
        registry="UPDATE mission_hints SET free_ms = NULL WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a drone that is free with more than a full battery",
        _FREE,
        registry="UPDATE mission_hints SET free_soc = 7.5 WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "the number of changes set back",
        _CHANGES,
        registry="UPDATE changes SET latest = 1",
    ),
    Corruption(
        "the number of changes deleted",
        _CHANGES,
        registry="DELETE FROM changes",
    ),
)

_ACROSS: Final = (
    Corruption(
        "a delivery that flies gone at the gateway",
        "a delivery of composition is a delivery of the gateway",
        gateway="DELETE FROM notifications WHERE delivery_id = :flying;"
        " DELETE FROM events WHERE delivery_id = :flying;"
        " DELETE FROM missions WHERE delivery_id = :flying;"
        " DELETE FROM custody WHERE delivery_id = :flying;"
        " DELETE FROM packages WHERE delivery_id = :flying;"
        " DELETE FROM idempotency WHERE location = '/v1/deliveries/' || :flying;"
        " DELETE FROM deliveries WHERE delivery_id = :flying",
    ),
    Corruption(
        "all of a mission gone in composition",
        "a mission of the gateway is a mission of composition",
        composition="DELETE FROM outbox; DELETE FROM custody WHERE mission_id = :booked_mission;"
        " DELETE FROM mission_steps WHERE mission_id = :booked_mission;"
        " DELETE FROM pad_reservations WHERE mission_id = :booked_mission;"
        " DELETE FROM instructions WHERE mission_id = :booked_mission;"
        " DELETE FROM missions WHERE mission_id = :booked_mission;"
        " DELETE FROM deliveries WHERE delivery_id = :booked;"
        " UPDATE drone_links SET last_seq = 0, stream = 0 WHERE drone_id = :silent_drone",
    ),
    Corruption(
        "a live mission for which the gateway does not wait",
        "a live mission is one of its delivery at the gateway",
        gateway="DELETE FROM missions WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a QUEUED mission for which the gateway does not wait",
        "a live mission is one of its delivery at the gateway",
        gateway="DELETE FROM missions WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a mission of which every report is refused for long",
        "the gateway knows each mission soon after its first report",
        gateway="DELETE FROM missions WHERE mission_id = :queued_mission;"
        " UPDATE deliveries SET is_queued = TRUE WHERE delivery_id ="
        " (SELECT delivery_id FROM packages WHERE mission_id = :queued_mission LIMIT 1)",
        composition="INSERT INTO outbox (channel, stream, address, payload, confirmed_by,"
        " mqtt_qos, is_retained, attempts)"
        " SELECT 'gateway', mission_id, '/internal/mission-reports',"
        " CAST(json_object('schema_version', 1, 'report_id', 'rpt_x', 'delivery_id', delivery_id,"
        " 'attempt', attempt, 'trip', trip, 'mission_id', mission_id, 'provider_id', provider_id,"
        " 'drone_id', drone_id, 'seq', 1, 'kind', 'QUEUED', 'at', '2026-03-01T12:00:00Z',"
        " 'mission_state', 'QUEUED') AS BLOB), 'sender', 0, 0, 9 FROM missions"
        " WHERE mission_id = :queued_mission;"
        " UPDATE missions SET report_seq = 1 WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a report lost between the services",
        "the gateway has every report that composition has sent",
        gateway="UPDATE missions SET report_seq = report_seq - 1"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a report that was never sent",
        "composition has sent every report that the gateway has",
        composition="UPDATE missions SET report_seq = report_seq - 1"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission with another drone at the gateway",
        "gateway and composition agree on a mission",
        gateway="UPDATE missions SET drone_id = :silent_drone,"
        " body = json_set(body, '$.drone_id', :silent_drone) WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission of another provider at the gateway",
        "gateway and composition agree on a mission",
        gateway="UPDATE missions SET provider_id = 'prv_other',"
        " body = json_set(body, '$.provider_id', 'prv_other') WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a line that pays a provider that did not fly",
        "a line names the parties of its mission",
        gateway="UPDATE ledger SET provider_id = 'prv_other' WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a package delivered at the gateway only",
        "I6 what the gateway counts as delivered is delivered in composition",
        gateway="INSERT INTO custody SELECT delivery_id, 'p2', 3, custodian_kind, 'line-s3', at_ms"
        " FROM custody WHERE delivery_id = :flying AND seq = 3;"
        " UPDATE packages SET state = 'DELIVERED', custodian_kind = 'RECIPIENT',"
        " custodian_id = 'line-s3', custody_seq = 3, delivered_ms = 1"
        " WHERE delivery_id = :flying AND package_id = 'p2'",
    ),
    Corruption(
        "a package delivered in composition only",
        "I6 what composition counts as delivered is delivered at the gateway",
        gateway="DELETE FROM custody WHERE delivery_id = :completed AND seq = 3",
    ),
    Corruption(
        "a package with another drone at the gateway",
        "I6 a drone that has a package at the gateway has it in composition",
        gateway="UPDATE custody SET custodian_id = :silent_drone"
        " WHERE delivery_id = :flying AND seq = 2",
    ),
    Corruption(
        "a package that no drone has at the gateway",
        "I6 a drone that has a package in composition has it at the gateway",
        gateway="DELETE FROM custody WHERE delivery_id = :flying AND package_id = 'p2'"
        " AND seq = 2; UPDATE packages SET custody_seq = 1, custodian_kind = 'STATION',"
        " custodian_id = 'line-s1', state = 'CREATED' WHERE delivery_id = :flying"
        " AND package_id = 'p2'",
    ),
    Corruption(
        "a drone deleted while it flies",
        _REGISTERED,
        registry="DELETE FROM mission_hints WHERE drone_id = :flying_drone;"
        " DELETE FROM enrolment_tokens WHERE drone_id = :flying_drone;"
        " DELETE FROM broker_accounts WHERE user_name = :flying_drone;"
        " DELETE FROM presence WHERE drone_id = :flying_drone;"
        " DELETE FROM drones WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a flying drone of another provider",
        _REGISTERED,
        registry="UPDATE drones SET provider_id = (SELECT provider_id FROM providers"
        " WHERE name = 'Silent Air') WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "the hint of a live mission deleted",
        "the registry knows that a drone on a live mission is busy",
        registry="DELETE FROM mission_hints WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a drone busy for ever",
        "the registry knows that a mission is over",
        registry="UPDATE mission_hints SET mission_state = 'ACTIVE', is_live = 1"
        " WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a QUEUED mission that the registry calls live",
        "the registry knows that a mission is over",
        registry="UPDATE mission_hints SET mission_state = 'ACTIVE', is_live = 1"
        " WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a hint of a mission that nobody booked",
        "the registry knows no mission that composition does not have",
        registry="UPDATE mission_hints SET mission_id = 'msn_invented'"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a provider's key whose provider is gone",
        "a provider that has a key is registered",
        gateway="UPDATE api_keys SET subject_id = 'prv_gone' WHERE role = 'provider'",
    ),
)

_RENEWALS: Final = (
    Corruption(
        "credentials renewed in the year 300,000",
        "credentials were renewed at a possible moment",
        registry="INSERT OR REPLACE INTO renewals VALUES (:flying_drone, 9405000000000000, 0, 1)",
    ),
)

_LEARNED: Final = (
    Corruption(
        "a drone that uses nine times the energy of its model",
        "what was learned about a drone is within its bounds",
        registry="INSERT OR REPLACE INTO learned_values (drone_id, flights, recharges,"
        " still_air_factor, state_of_health, charge_rate_factor, is_maintenance_due,"
        " learned_session, learned_seq, learned_ms, since_ms)"
        " VALUES (:flying_drone, 1, 0, 9.0, 1.0, 1.0, 0, 0, 0, 0, 0)",
    ),
)

_INSTALLED: Final = "a battery is in at most one drone, of its own provider and model"
_DUE: Final = "a drone is due for maintenance if it is over a limit of its rule"


def _battery(health: float = 1.0, model_id: str = "model_id", used_soc: float = 0.0) -> str:
    """SQL that installs a battery in the drone that flies; the model may be another column."""
    return (
        "INSERT INTO batteries SELECT 'bat_1', provider_id,"
        f" {model_id}, 'S1', 1e6, {health}, 0, {used_soc}, drone_id, 5000, 0, 0"
        " FROM drones WHERE drone_id = :flying_drone"
    )


_BATTERIES: Final = (
    Corruption(
        "a battery in a drone of another model",
        _INSTALLED,
        registry=_battery(model_id="'m300'"),
    ),
    Corruption(
        "a battery that was in another drone at the same time",
        _INSTALLED,
        registry=f"{_battery()};"
        " INSERT INTO past_installations VALUES ('bat_1', 1000, 6000, :silent_drone, 0)",
    ),
    Corruption(
        "a battery that was in two drones at the same time",
        "a battery was in one drone after the other",
        registry=f"{_battery()};"
        " INSERT INTO past_installations VALUES ('bat_1', 1000, 3000, :silent_drone, 0);"
        " INSERT INTO past_installations VALUES ('bat_1', 2000, 4000, :flying_drone, 0)",
    ),
    Corruption(
        "a battery that gave less than nothing",
        "what is known about a battery is possible",
        registry=_battery(used_soc=-1.0),
    ),
    Corruption(
        "a drone that was maintained after more flights than it has flown",
        "what a drone has flown is possible",
        registry="UPDATE drones SET maintained_flown_s = 1e9 WHERE drone_id = :silent_drone",
    ),
    Corruption(
        "a maintenance rule without a limit",
        "a maintenance rule has a limit",
        registry="INSERT INTO maintenance_rules SELECT provider_id, model_id, NULL, NULL"
        " FROM drones WHERE drone_id = :silent_drone",
    ),
    Corruption(
        "a drone that is due without a rule",
        _DUE,
        registry="UPDATE drones SET maintenance_due_ms = 1 WHERE drone_id = :silent_drone",
    ),
    Corruption(
        "a drone over a limit that nobody calls to maintenance",
        _DUE,
        registry="INSERT INTO maintenance_rules SELECT provider_id, model_id, 1e-9, NULL"
        " FROM drones WHERE drone_id = :flying_drone",
    ),
)

REGISTRY_CORRUPTIONS: Final = (*_REGISTRY, *_RENEWALS, *_LEARNED, *_BATTERIES, *_ACROSS)
