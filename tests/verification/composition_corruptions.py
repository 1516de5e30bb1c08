"""Corruptions of composition's storage, pads, networks, and links to drones."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_YEAR_3000_MS: Final = 32_503_680_000_000
_INSTRUCTIONS_COUNTED: Final = "I7 a link counts the drone's instructions"
_EVENTS_COUNTED: Final = "I7 a link counts the drone's events"
_FORM: Final = "every stored text has its form"

_STORAGE: Final = (
    Corruption(
        "a change of custody at the end of the calendar",
        "every moment and number is one that Skyway writes",
        composition="UPDATE custody SET at_ms = 253402300800000",
    ),
    Corruption(
        "an index that lacks its rows",
        "every page of the database is whole",
        composition="PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql,"
        " 'RECIPIENT', 'DRONE') WHERE name = 'custody_delivered' AND type = 'index';"
        " PRAGMA writable_schema = RESET",
    ),
    Corruption(
        "a trigger dropped",
        "every index and trigger of the newest migration exists",
        composition="DROP TRIGGER pad_taken_on_insert",
    ),
    Corruption(
        "a mission deleted with its children left",
        "every row that is referred to exists",
        composition="DELETE FROM missions WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "bytes in a column of texts",
        "every text is stored as text",
        composition="UPDATE missions SET told = x'00ff' WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission claimed until the year 3000",
        "no claim lasts longer than ten minutes",
        composition=f"UPDATE missions SET claimed_by = 'x', claimed_until_ms = {_YEAR_3000_MS}"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "an instruction in the outbox claimed until the year 3000",
        "no claim lasts longer than ten minutes",
        composition=f"UPDATE outbox SET claimed_by = 'x', claimed_until_ms = {_YEAR_3000_MS}",
    ),
    Corruption(
        "an instruction in the outbox due in the year 3000",
        "a message in the outbox is sent again within ten minutes",
        composition=f"UPDATE outbox SET due_at_ms = {_YEAR_3000_MS}",
    ),
    Corruption(
        "a message to nobody",
        "a message in the outbox has a receiver",
        composition="UPDATE outbox SET channel = 'pigeon'",
    ),
    Corruption(
        "half of a mission",
        _FORM,
        composition="UPDATE missions SET body = substr(body, 1, 90)"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "half of a message in the outbox",
        _FORM,
        composition="UPDATE outbox SET payload = substr(payload, 1, 90)",
    ),
    Corruption(
        "a state of charge that is not a number",
        _FORM,
        composition='UPDATE drone_links SET state = replace(state, \'"soc":\', \'"soc":NaN,"s":\')'
        " WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a price below zero",
        _FORM,
        composition="UPDATE missions SET body = json_set(body, '$.price.amount', -5)"
        " WHERE mission_id = :flying_mission",
    ),
)

_PADS: Final = (
    Corruption(
        "two reservations that overlap",
        "I1 no pad holds two overlapping reservations",
        composition="DROP TRIGGER pad_taken_on_insert; INSERT INTO pad_reservations"
        " (station_id, pad, start_ms, end_ms, mission_id)"
        " SELECT station_id, pad, start_ms + 1, end_ms, :booked_mission FROM pad_reservations"
        " WHERE mission_id = :flying_mission AND station_id = 'line-s2'",
    ),
    Corruption(
        "a reserved pad that the station has not",
        "I1 a reserved pad is a pad of its station",
        composition="UPDATE pad_reservations SET pad = 9 WHERE mission_id = :flying_mission"
        " AND station_id = 'line-s2'",
    ),
    Corruption(
        "a planned pad below zero",
        "I1 a planned recharge uses a pad of its station",
        composition="UPDATE mission_steps SET pad = -1 WHERE mission_id = :flying_mission"
        " AND kind = 'RECHARGE'",
    ),
    Corruption(
        "a reservation of a mission that is over",
        "I3 a reservation has a mission that is not over",
        composition="UPDATE pad_reservations SET mission_id = :completed_mission"
        " WHERE station_id = 'line-s2' AND hold_id IS NULL",
    ),
    Corruption(
        "a reservation deleted",
        "I3 a mission holds the pads of its steps",
        composition="DELETE FROM pad_reservations WHERE station_id = 'line-s2'",
    ),
    Corruption(
        "a reservation that never ends",
        "I3 a mission holds no pad that it does not need",
        composition="DROP TRIGGER pad_taken_on_update;"
        f" UPDATE pad_reservations SET end_ms = {_YEAR_3000_MS}"
        " WHERE mission_id = :booked_mission",
    ),
)

_NETWORKS: Final = (
    Corruption(
        "a closed station under a live plan",
        "I11 no live plan uses what is closed",
        composition="UPDATE closures SET station_id = 'line-s3'",
    ),
    Corruption(
        "a closed pad under a live plan",
        "I11 no live plan uses what is closed",
        # A drone that was asked to give way has two plans until it answers, and pads of both.
        composition="UPDATE missions SET proposal = NULL;"
        " UPDATE closures SET kind = 'PAD', (station_id, pad) ="
        " (SELECT station_id, pad FROM mission_steps WHERE mission_id = :flying_mission"
        " AND kind = 'RECHARGE' AND status = 'PLANNED' ORDER BY planned_start_ms DESC LIMIT 1)",
    ),
    Corruption(
        "a closure that no cache notices",
        "I11 a network's conditions count every closure",
        composition="UPDATE networks SET conditions = 0",
    ),
    Corruption(
        "a forecast written by hand",
        "a forecast can be read, is not from the future, and its content has its hash",
        composition="UPDATE forecasts SET content = CAST('{}' AS BLOB)",
    ),
    Corruption(
        "a closure lifted before it was made",
        "a closure is lifted after it was made",
        composition="UPDATE closures SET lifted_ms = made_ms - 1;"
        " UPDATE networks SET conditions = conditions + 1",
    ),
    Corruption(
        "a version ahead of what is kept",
        "I12 a current version is kept",
        composition="UPDATE networks SET version = 7",
    ),
    Corruption(
        "a version between that nobody published",
        "I12 a network has all its versions from the oldest kept one up to the current one",
        composition="INSERT INTO network_versions SELECT network_id, 5, sha256, published_ms,"
        " content FROM network_versions",
    ),
    Corruption(
        "a network's content changed under its hash",
        "I12 a version's content has its hash",
        composition="UPDATE network_versions SET content ="
        " CAST(replace(CAST(content AS TEXT), '\"pads\":2', '\"pads\":8') AS BLOB)",
    ),
    Corruption(
        "a station moved",
        "I12 the stations are those of the current version",
        composition="UPDATE stations SET longitude_deg = -90.0 WHERE station_id = 'line-s3'",
    ),
    Corruption(
        "the pads of a station changed",
        "I12 the stations are those of the current version",
        composition="UPDATE stations SET pads = 50 WHERE station_id = 'line-s3'",
    ),
)

_LINKS: Final = (
    Corruption(
        "a gap before an unanswered instruction",
        "I7 an unanswered instruction follows the one before it",
        composition="UPDATE instructions SET seq = seq + 20 WHERE status IN ('SENT', 'RECEIVED')",
    ),
    Corruption(
        "an unanswered instruction that no outbox repeats",
        "I7 an unanswered instruction is in the outbox",
        composition="DELETE FROM outbox",
    ),
    Corruption(
        "an unanswered instruction repeated to another drone",
        "I7 an unanswered instruction is in the outbox",
        composition="UPDATE outbox SET stream = :flying_drone",
    ),
    Corruption(
        "an answered instruction set back to sent",
        "I7 an unanswered instruction is in the outbox",
        composition="UPDATE instructions SET status = 'SENT' WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "an answered instruction that is repeated",
        "I7 an answered instruction is not repeated",
        composition="UPDATE instructions SET status = 'REJECTED'"
        " WHERE mission_id = :booked_mission",
    ),
    Corruption(
        "another text in the outbox",
        "I7 the outbox repeats an instruction as it was stored",
        composition="UPDATE outbox SET payload = CAST(json_set(CAST(payload AS TEXT), '$.seq', 4)"
        " AS BLOB)",
    ),
    Corruption(
        "an instruction in the outbox on the topic of another drone",
        "I7 the outbox repeats an instruction as it was stored",
        composition="UPDATE outbox SET address = replace(address, :silent_drone, :flying_drone)",
    ),
    Corruption(
        "an instruction's columns changed",
        "an instruction's columns say what its body says",
        composition="UPDATE instructions SET mission_revision = 4"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a link that counts too few instructions",
        _INSTRUCTIONS_COUNTED,
        composition="UPDATE drone_links SET last_seq = 1 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a link that counts too many instructions",
        _INSTRUCTIONS_COUNTED,
        composition="UPDATE drone_links SET last_seq = 90 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a link set back to an older stream",
        _INSTRUCTIONS_COUNTED,
        composition="UPDATE drone_links SET stream = 0, acked_stream = 0"
        " WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a link that counts too few events",
        _EVENTS_COUNTED,
        composition="UPDATE drone_links SET last_event_seq = 1 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a link that counts too many events",
        _EVENTS_COUNTED,
        composition="UPDATE drone_links SET last_event_seq = 500 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a flying drone that is not occupied",
        "I2 a link says whether its drone is occupied",
        composition="UPDATE drone_links SET is_occupied = 0 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "an idle drone that is occupied",
        "I2 a link says whether its drone is occupied",
        composition="UPDATE drone_links SET is_occupied = 1 WHERE drone_id = :silent_drone",
    ),
    Corruption(
        "a link with another provider",
        "a link belongs to the provider of its drone's missions",
        composition="UPDATE drone_links SET provider_id = 'prv_other'"
        " WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a report that waits with the number of another",
        "a mission's waiting reports are its last ones",
        composition="INSERT INTO outbox (channel, stream, address, payload, confirmed_by,"
        " mqtt_qos, is_retained) SELECT 'gateway', mission_id, '/internal/mission-reports',"
        " CAST(json_object('schema_version', 1, 'report_id', 'rpt_x', 'delivery_id', delivery_id,"
        " 'attempt', 1, 'trip', 1, 'mission_id', mission_id, 'provider_id', provider_id,"
        " 'drone_id', drone_id, 'seq', 99, 'kind', 'ACCEPTED', 'at', '2026-03-01T12:00:00Z',"
        " 'mission_state', 'ACTIVE') AS BLOB), 'sender', 0, 0 FROM missions"
        " WHERE mission_id = :flying_mission",
    ),
)

_QUARANTINE: Final = (
    Corruption(
        "a replica that joined after it was seen last",
        "a replica was seen since it joined",
        composition="INSERT INTO replicas VALUES ('composition-1', 2, 1, 1)",
    ),
    Corruption(
        "a link that was renewed before there were drones",
        "a link was renewed at a possible moment",
        composition="UPDATE drone_links SET renewed_ms = -1 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a set-aside message that lacks a part",
        "a set-aside message is shown as it arrived",
        composition="INSERT INTO quarantine VALUES ('qua_1', 'skyway/v1/prv_1/drn_1/acks', 'prv_1',"
        " 'drn_1', 'UNREADABLE', 'x', x'7b', 'of another payload', 2, 1, 0, 0, 0)",
    ),
)

COMPOSITION_CORRUPTIONS: Final = (*_STORAGE, *_PADS, *_NETWORKS, *_LINKS, *_QUARANTINE)
