"""Corruptions of the gateway's database: deliveries, packages, events, notifications."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_YEAR_3000_MS: Final = 32_503_680_000_000
_LAST_EVENT: Final = (
    "WHERE delivery_id = :flying AND sequence ="
    " (SELECT last_sequence FROM deliveries WHERE delivery_id = :flying)"
)

_EVENTS_CHANGED: Final = "a delivery's events are those that were recorded"

_STORAGE: Final = (
    Corruption(
        "an index dropped",
        "every index and trigger of the newest migration exists",
        gateway="DROP INDEX custody_delivered",
    ),
    Corruption(
        "a delivery deleted with its packages left",
        "every row that is referred to exists",
        gateway="DELETE FROM deliveries WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a number in a column of texts",
        "every text is stored as text",
        gateway="UPDATE packages SET custodian_id = x'00ff' WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a delivery claimed until the year 3000",
        "no claim lasts longer than ten minutes",
        gateway=f"UPDATE deliveries SET claimed_by = 'x', claimed_until_ms = {_YEAR_3000_MS}"
        " WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a notification claimed until the year 3000",
        "no claim lasts longer than ten minutes",
        gateway=f"UPDATE notifications SET claimed_by = 'x', claimed_until_ms = {_YEAR_3000_MS}"
        " WHERE webhook_id = :deaf_webhook AND sequence = 1 AND delivery_id = :completed",
    ),
    Corruption(
        "half of a request",
        "every stored text has its form",
        gateway="UPDATE deliveries SET request = substr(request, 1, 40)"
        " WHERE delivery_id = :flying",
    ),
    Corruption(
        "a proof with a charge above full",
        "every stored text has its form",
        gateway="UPDATE packages SET proof = json_set(proof, '$.soc', 7.5)"
        " WHERE delivery_id = :completed",
    ),
    Corruption(
        "an offer without its price",
        "every stored text has its form",
        gateway="UPDATE deliveries SET offer = json_remove(offer, '$.price')"
        " WHERE delivery_id = :completed",
    ),
)

_DELIVERIES: Final = (
    Corruption(
        "a request that nobody decides",
        "I5 a request is decided in bounded time",
        gateway="UPDATE deliveries SET give_up_ms = 1 WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a request that is tried again in the year 3000",
        "I5 booking looks at a queued delivery again within seconds",
        gateway=f"UPDATE deliveries SET next_try_wall_ms = {_YEAR_3000_MS}"
        " WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a completed delivery in the queue",
        "I5 a delivery is queued while packages of it wait",
        gateway="UPDATE deliveries SET is_queued = 1 WHERE delivery_id = :completed",
    ),
    Corruption(
        "a request scheduled for no time",
        "I5 a scheduled delivery is requested before its pickup",
        gateway="UPDATE deliveries SET state = 'SCHEDULED', is_queued = 0,"
        " earliest_pickup_ms = NULL WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a waiting request out of the queue",
        "I5 a request that nobody flies is queued",
        gateway="UPDATE deliveries SET is_queued = 0 WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a completed delivery that waits for a drone",
        "I5 a request that waits for a drone is queued",
        gateway="UPDATE deliveries SET waits_since_ms = 1 WHERE delivery_id = :completed",
    ),
    Corruption(
        "a request moved to the front of the queue",
        "I5 requests wait in the order of their classes",
        gateway="UPDATE deliveries SET queue_rank = 0 WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a delivery completed twice",
        "I5 a delivery that is over has exactly one final event, as its last",
        gateway="INSERT INTO events SELECT 'evt_again', delivery_id, sequence + 1, type, body,"
        " recorded_wall_ms FROM events WHERE type = 'delivery.completed';"
        " UPDATE deliveries SET last_sequence = last_sequence + 1 WHERE delivery_id = :completed",
    ),
    Corruption(
        "a completed delivery opened again",
        "I5 a delivery that goes on has no final event",
        gateway="UPDATE deliveries SET state = 'IN_PROGRESS' WHERE delivery_id = :completed",
    ),
    Corruption(
        "a flying delivery whose mission has ended",
        "I5 a delivery under way has a mission under way, or packages that wait for one",
        gateway="UPDATE missions SET state = 'ABORTED', ended_ms = 1"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a delivery completed with a package in the air",
        "I5 a delivery is over when all its packages are",
        gateway="UPDATE deliveries SET state = 'COMPLETED' WHERE delivery_id = :flying",
    ),
    Corruption(
        "a completed delivery called failed",
        "I5 a delivery ends as its packages did",
        gateway="UPDATE deliveries SET state = 'FAILED' WHERE delivery_id = :completed",
    ),
    Corruption(
        "a package deleted",
        "a delivery has the packages of its request",
        gateway="DELETE FROM packages WHERE delivery_id = :flying AND package_id = 'p2'",
    ),
    Corruption(
        "a package made heavier",
        "a delivery has the packages of its request",
        gateway="UPDATE packages SET mass_kg = 5.0 WHERE delivery_id = :flying",
    ),
    Corruption(
        "a mass below zero",
        "a delivery has the packages of its request",
        gateway="UPDATE packages SET mass_kg = -1.0 WHERE delivery_id = :flying",
    ),
    Corruption(
        "a delivery given to another customer",
        "an accepted quote has its delivery",
        gateway="UPDATE deliveries SET customer_id = 'thief' WHERE delivery_id = :completed",
    ),
    Corruption(
        "the price of a quote changed",
        "a delivery of an accepted offer has its limits",
        gateway="UPDATE quotes SET offers = json_set(offers, '$[0].price.amount', 1)",
    ),
    Corruption(
        "an accepted offer that was lost for no reason",
        "I17 an accepted offer is flown, or its failure has a cause after the acceptance",
        gateway="UPDATE deliveries SET state = 'REJECTED', reasons = '[]'"
        " WHERE delivery_id = :completed",
    ),
    Corruption(
        "the limit of an accepted offer changed",
        "a delivery of an accepted offer has its limits",
        gateway="UPDATE deliveries SET offer = json_set(offer, '$.price.amount', 999999)"
        " WHERE delivery_id = :completed",
    ),
    Corruption(
        "the tariff of an offer that was made anew",
        "a delivery of an accepted offer has its limits",
        gateway="UPDATE deliveries SET offer = json_set(offer, '$.tariff.base', 1, '$.hold', NULL)"
        " WHERE delivery_id = :completed",
    ),
)

_PACKAGES: Final = (
    Corruption(
        "a package in the air without a mission",
        "I6 a package on its way has one mission, which is under way",
        gateway="UPDATE packages SET mission_id = NULL"
        " WHERE delivery_id = :flying AND package_id = 'p2'",
    ),
    Corruption(
        "a package with another delivery's mission",
        "I6 a package's mission is one of its delivery's",
        gateway="UPDATE packages SET mission_id = :flying_mission WHERE delivery_id = :completed",
    ),
    Corruption(
        "a link of a chain of custody deleted",
        "I6 a package's chain of custody has no gap",
        gateway="DELETE FROM custody WHERE delivery_id = :completed AND seq = 2",
    ),
    Corruption(
        "a package with another custodian than its chain's last",
        "I6 a package's custodian is the last one of its chain",
        gateway="UPDATE packages SET custodian_id = 'line-s2' WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a package delivered without a recipient",
        "I6 a package is delivered once, and then with its recipient",
        gateway="UPDATE packages SET state = 'DELIVERED' WHERE delivery_id = :waiting",
    ),
    Corruption(
        "a package stranded with its recipient",
        "I6 a package is where its state says",
        gateway="UPDATE packages SET state = 'RETURNED'"
        " WHERE delivery_id = :flying AND package_id = 'p1'",
    ),
    Corruption(
        "a chain of custody that begins elsewhere",
        "I6 a chain of custody begins at the pickup",
        gateway="UPDATE custody SET custodian_id = 'line-s2'"
        " WHERE delivery_id = :flying AND seq = 1",
    ),
    Corruption(
        "a package handed over by a station",
        "I6 packages pass from station to drone and from drone to station or recipient",
        gateway="UPDATE custody SET custodian_kind = 'STATION'"
        " WHERE delivery_id = :completed AND seq = 2",
    ),
    Corruption(
        "a package carried by a drone of another delivery",
        "I6 only drones of the delivery's missions have its packages",
        gateway="UPDATE custody SET custodian_id = :silent_drone"
        " WHERE delivery_id = :flying AND seq = 2",
    ),
    Corruption(
        "a package delivered at another station",
        "I6 a package is delivered at its destination or its alternative",
        gateway="UPDATE custody SET custodian_id = 'line-s2'"
        " WHERE delivery_id = :completed AND seq = 3",
    ),
    Corruption(
        "a package delivered an hour later than its customer was notified",
        "I6 a package ends as its customer was notified",
        gateway="UPDATE packages SET delivered_ms = delivered_ms + 3600000"
        " WHERE delivery_id = :completed",
    ),
    Corruption(
        "a package that is due when nothing was promised",
        "a package is due at the moment that was promised",
        gateway="UPDATE packages SET due_ms = promised_ms + 1"
        " WHERE delivery_id = :flying AND package_id = 'p2'",
    ),
    Corruption(
        "a P90 before the promise",
        "a package has a P90 only with a promise, and not before it",
        gateway="UPDATE packages SET promised_p90_ms = promised_ms - 1"
        " WHERE delivery_id = :completed",
    ),
    Corruption(
        "the proof of another station",
        "a delivered package has the proof of its hand-over",
        gateway="UPDATE packages SET proof = json_set(proof, '$.station_id', 'line-s2')"
        " WHERE delivery_id = :completed",
    ),
    *(
        Corruption(
            f"the {name} of a proof changed",
            "a delivered package has the proof of its hand-over",
            gateway=f"UPDATE packages SET proof = json_set(proof, '$.{name}', {value})"
            " WHERE delivery_id = :completed",
        )
        for name, value in (
            ("drone_id", "'drn_another'"),
            ("provider_id", "'prv_another'"),
            ("mass_kg", "0.123"),
            ("load_before_kg", "0.123"),
            ("load_after_kg", "0.123"),
            ("position", "json('[-97.5, 29.5]')"),
        )
    ),
    Corruption(
        "a proof deleted",
        "a delivered package has the proof of its hand-over",
        gateway="UPDATE packages SET proof = NULL WHERE delivery_id = :completed",
    ),
)

_MISSIONS: Final = (
    Corruption(
        "the money of a mission changed",
        "a mission's columns say what its body says",
        gateway="UPDATE missions SET price_amount = price_amount * 10"
        " WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "the money of a mission changed in columns and body",
        "gateway and composition agree on a mission",
        gateway="UPDATE missions SET price_amount = 1,"
        " body = json_set(body, '$.price.amount', 1) WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a mission that is over without its end",
        "a mission that is over has its end",
        gateway="UPDATE missions SET ended_ms = NULL WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "an attempt set back",
        "a mission belongs to an attempt that was made",
        gateway="UPDATE deliveries SET attempt = 0 WHERE delivery_id = :flying",
    ),
)

_EVENTS: Final = (
    Corruption(
        "an event deleted",
        "a delivery's events have no gap",
        gateway="DELETE FROM notifications WHERE delivery_id = :flying AND sequence = 3;"
        " DELETE FROM events WHERE delivery_id = :flying AND sequence = 3",
    ),
    Corruption(
        "the last event deleted, and the number too",
        _EVENTS_CHANGED,
        gateway=f"DELETE FROM notifications {_LAST_EVENT}; DELETE FROM events {_LAST_EVENT};"
        " UPDATE deliveries SET last_sequence = last_sequence - 1 WHERE delivery_id = :flying",
    ),
    Corruption(
        "an event's body changed",
        _EVENTS_CHANGED,
        gateway="UPDATE events SET body = json_set(body, '$.data.provider_id', 'prv_other')"
        " WHERE delivery_id = :flying AND sequence = 2",
    ),
    Corruption(
        "two events exchanged",
        _EVENTS_CHANGED,
        gateway="UPDATE events SET sequence = 900 WHERE delivery_id = :flying AND sequence = 4;"
        " UPDATE events SET sequence = 4 WHERE delivery_id = :flying AND sequence = 5;"
        " UPDATE events SET sequence = 5 WHERE delivery_id = :flying AND sequence = 900",
    ),
    Corruption(
        "a sequence number far ahead",
        "a delivery's events have no gap",
        gateway="UPDATE events SET sequence = 200 WHERE delivery_id = :flying AND sequence = 5",
    ),
    Corruption(
        "an exchange without an event",
        "both providers of an exchange see it as its event says",
        gateway="INSERT INTO exchanges SELECT 'prv_other', event_id, delivery_id, 'msn_1', 'LEFT',"
        " 0 FROM events WHERE delivery_id = :flying AND sequence = 1",
    ),
    Corruption(
        "an event's type changed",
        "an event's columns say what its body says",
        gateway="UPDATE events SET type = 'delivery.delayed'"
        " WHERE delivery_id = :flying AND sequence = 3",
    ),
)

_NOTIFICATIONS: Final = (
    Corruption(
        "a notification deleted",
        "I14 each webhook is notified of each event that it subscribes to",
        gateway="DELETE FROM notifications WHERE webhook_id = :webhook AND sequence = 2"
        " AND delivery_id = :completed",
    ),
    Corruption(
        "a notification delivered before the one before it",
        "I14 notifications of a delivery arrive in sequence",
        gateway="UPDATE notifications SET state = 'DELIVERED'"
        " WHERE webhook_id = :deaf_webhook AND sequence = 2 AND delivery_id = :completed",
    ),
    Corruption(
        "a notification delivered without an attempt",
        "I14 a notification that was delivered or tried has its attempt",
        gateway="UPDATE notifications SET state = 'DELIVERED'"
        " WHERE webhook_id = :deaf_webhook AND sequence = 1 AND delivery_id = :cancelled",
    ),
    Corruption(
        "the attempts at a webhook deleted",
        "I14 a notification that was delivered or tried has its attempt",
        gateway="DELETE FROM webhook_attempts WHERE webhook_id = :webhook",
    ),
    Corruption(
        "a notification with the number of another event",
        "I14 a notification is about its event",
        gateway="UPDATE notifications SET sequence = 500 WHERE webhook_id = :webhook"
        " AND sequence = 1 AND delivery_id = :completed",
    ),
    Corruption(
        "a notification tried again in the year 3000",
        "I14 a notification is tried again within its schedule",
        gateway=f"UPDATE notifications SET next_try_wall_ms = {_YEAR_3000_MS}"
        " WHERE webhook_id = :deaf_webhook AND sequence = 1 AND delivery_id = :completed",
    ),
    Corruption(
        "a webhook's secret cut",
        "every stored text has its form",
        gateway="UPDATE webhooks SET secret = 'whsec_' WHERE webhook_id = :webhook",
    ),
    Corruption(
        "a webhook without an address",
        "every stored text has its form",
        gateway="UPDATE webhooks SET url = 'nowhere' WHERE webhook_id = :webhook",
    ),
)

GATEWAY_CORRUPTIONS: Final = (
    *_STORAGE,
    *_DELIVERIES,
    *_PACKAGES,
    *_MISSIONS,
    *_EVENTS,
    *_NOTIFICATIONS,
)
