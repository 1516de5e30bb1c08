"""Corruptions of drones' calendars: of missions that wait for the missions before them."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_STATED: Final = "I16 a mission's stays and end of service are those of its plan"
_FOLLOWS: Final = "I16 a QUEUED mission begins where the one before it leaves the drone"
_PLANNED: Final = "I16 a QUEUED mission has a plan of its network, and only a QUEUED one waits"
_TRIGGERS: Final = "every index and trigger of the newest migration exists"

#: On a slow machine the mission may wait to be planned again, and is not compared meanwhile.
_UP_TO_DATE = (
    "UPDATE missions SET planned_conditions = 1 WHERE mission_id = :queued_behind_mission;"
)

CALENDAR_CORRUPTIONS: Final = (
    Corruption(
        "a held drone that is given to others too early",
        "I17 a held drone names its hold, and is held as long",
        composition="UPDATE drone_links SET held_until_ms = 1 WHERE drone_id = :idle_drone",
    ),
    Corruption(
        "a held pad that is given to others too early",
        "I17 a held pad is held as long as its hold",
        composition="UPDATE pad_reservations SET held_until_ms = 1 WHERE hold_id IS NOT NULL",
    ),
    Corruption(
        "a held drone that is free for others",
        "I17 a hold keeps the drones of its offers",
        composition="UPDATE drone_links SET held_by = NULL, held_until_ms = NULL"
        " WHERE drone_id = :idle_drone",
    ),
    Corruption(
        "a held pad that is free for others",
        "I17 a hold keeps the pads of its offers",
        composition="DELETE FROM pad_reservations WHERE hold_id IS NOT NULL",
    ),
    Corruption(
        "half of the promised arrivals of a QUEUED mission",
        "every stored text has its form",
        composition="UPDATE missions SET promised = '[{' WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a firm promise of a QUEUED mission that is provisional again",
        "a mission's columns say what its body says",
        composition="UPDATE missions SET firm_ms = 1 WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a day without better orders",
        "what better orders have saved is counted by days",
        composition="INSERT INTO better_orders (provider_id, day_ms, orders, moves, saved_ms)"
        " VALUES ('prv_1', 86400000, 0, 0, 0)",
    ),
    Corruption(
        "half of the offers of a hold",
        "every stored text has its form",
        composition="UPDATE offer_holds SET offers = substr(offers, 1, 40)",
    ),
    Corruption(
        "the trigger on new times of drones dropped",
        _TRIGGERS,
        composition="DROP TRIGGER drone_time_taken_on_insert",
    ),
    Corruption(
        "the trigger on changed times of drones dropped",
        _TRIGGERS,
        composition="DROP TRIGGER drone_time_taken_on_update",
    ),
    Corruption(
        "two QUEUED missions that overlap",
        "I16 QUEUED missions of a drone do not overlap",
        composition="DROP TRIGGER drone_time_taken_on_update; UPDATE missions SET start_ms ="
        " (SELECT served_ms - 1 FROM missions WHERE mission_id = :queued_mission)"
        " WHERE mission_id = :queued_behind_mission",
    ),
    Corruption(
        "a QUEUED mission that begins elsewhere than the one before ends",
        _FOLLOWS,
        composition=_UP_TO_DATE
        + "UPDATE missions SET candidate = json_set(candidate, '$.station_id', 'line-s3')"
        " WHERE mission_id = :queued_behind_mission",
    ),
    Corruption(
        "a QUEUED mission that begins with more charge than the one before leaves",
        _FOLLOWS,
        composition=_UP_TO_DATE
        + "UPDATE missions SET candidate = json_set(candidate, '$.soc', 1.0)"
        " WHERE mission_id = :queued_behind_mission",
    ),
    Corruption(
        "a QUEUED mission that ends elsewhere than the next one begins",
        _FOLLOWS,
        composition=_UP_TO_DATE
        + "UPDATE missions SET stays = replace(stays, 'line-near', 'line-s3')"
        " WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "half of the stays of a mission",
        "every stored text has its form",
        composition="""UPDATE missions SET stays = '[["line-s1",1,2,0.5'"""
        " WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a stay without its charge",
        "every stored text has its form",
        composition="""UPDATE missions SET stays = '[["line-s1",1,2]]'"""
        " WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "the stays of a QUEUED mission deleted",
        _STATED,
        composition="UPDATE missions SET stays = NULL WHERE mission_id = :queued_behind_mission",
    ),
    Corruption(
        "a flying drone that is free an hour too early",
        _STATED,
        composition="UPDATE missions SET served_ms = served_ms - 3600000"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a QUEUED mission that no longer knows its network",
        _PLANNED,
        composition="UPDATE missions SET planned_version = NULL WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a QUEUED mission that no closure can change",
        _PLANNED,
        composition="UPDATE missions SET planned_conditions = NULL"
        " WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a QUEUED mission that takes no time",
        _PLANNED,
        composition="UPDATE missions SET served_ms = start_ms"
        " WHERE mission_id = :queued_behind_mission",
    ),
    Corruption(
        "a live mission that waits in the calendar",
        _PLANNED,
        composition="UPDATE missions SET planned_version = 1, planned_conditions = 1"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission that was sent put back into the calendar",
        "I16 a QUEUED mission was not sent to its drone",
        composition="UPDATE missions SET state = 'QUEUED', body = json_set(body, '$.state',"
        " 'QUEUED'), planned_version = 1, planned_conditions = 1"
        " WHERE mission_id = :booked_mission",
    ),
    Corruption(
        "the pads of a QUEUED mission freed",
        "I3 a mission holds the pads of its steps",
        composition="DELETE FROM pad_reservations WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "the steps of a QUEUED mission deleted",
        "I4 a mission has steps",
        composition="DELETE FROM mission_steps WHERE mission_id = :queued_mission",
    ),
    Corruption(
        "a delivery closed while its mission is QUEUED",
        "a closed delivery has no mission that is not over",
        composition="UPDATE deliveries SET closed_ms = 1 WHERE delivery_id = :queued",
    ),
)
