"""Corruptions of composition's missions, their steps, and the custody of packages."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_YEAR_3000_MS: Final = 32_503_680_000_000
_STEPS_SENT: Final = "I4 a mission's steps are those that were sent"
_ENERGY: Final = "I10 a live mission's steps need no more energy than the battery has"
_WINDOWS: Final = "a mission's first plan keeps the windows and the deadline of its request"
_EVIDENCE: Final = "a step that has ended has the drone's event as evidence"
#: The last flight with the second package.
_LAST: Final = "WHERE mission_id = :flying_mission AND to_station_id = 'line-s3'"
_LONGER: Final = "UPDATE mission_steps SET step = json_set(step, '$.length_m', 99000.0) " + _LAST

_MISSIONS: Final = (
    Corruption(
        "two live missions of one drone",
        "I2 a drone is on at most one mission",
        composition="DROP INDEX mission_drone;"
        " UPDATE missions SET state = 'ACTIVE' WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "the instruction of a mission deleted",
        "I4 a mission was sent to its drone",
        composition="DELETE FROM instructions WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a provider blamed for a mission that was flown",
        "a no-show is a mission of its provider that was refused or aborted",
        composition="INSERT INTO no_shows (mission_id, provider_id, drone_id, code, at_ms)"
        " SELECT mission_id, provider_id, drone_id, 'SILENT', 1 FROM missions"
        " WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "the steps of a mission deleted",
        "I4 a mission has steps",
        composition="DELETE FROM mission_steps WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "the link of a flying drone deleted",
        "I4 a mission that is not over has a link to its drone",
        composition="DELETE FROM drone_links WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "the link of an idle drone deleted",
        "I7 an instruction has a link to its drone",
        composition="DELETE FROM drone_links WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a booked mission whose instruction was answered",
        "I7 a booked mission waits for its drone's answer",
        composition="UPDATE instructions SET status = 'ACCEPTED'"
        " WHERE mission_id = :booked_mission; DELETE FROM outbox",
    ),
    Corruption(
        "a proposal that no instruction carries",
        "I7 a proposal waits for its drone's answer",
        composition="UPDATE missions SET proposal = json_object('instruction_id', 'ins_gone',"
        " 'mission', json(body), 'steps', json('[]')) WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission given to another drone",
        "a mission's columns say what its body says",
        composition="UPDATE missions SET drone_id = 'drn_other' WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "the money of a mission changed at composition",
        "gateway and composition agree on a mission",
        composition="UPDATE missions SET body = json_set(body, '$.price.amount', 999999)"
        " WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a mission that is over and in trouble",
        "a mission that is over needs no plan",
        composition="UPDATE missions SET trouble = '{}' WHERE mission_id = :completed_mission",
    ),
    Corruption(
        "a mission that is checked in the year 3000",
        "a mission is checked when its next step should have ended",
        composition=f"UPDATE missions SET next_end_ms = {_YEAR_3000_MS}"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission that is planned again in the year 3000",
        "a mission that needs a plan is looked at again within seconds",
        composition=f"UPDATE missions SET retry_wall_ms = {_YEAR_3000_MS}"
        " WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a withdrawn attempt that is still flown",
        "a withdrawn attempt has no mission that is not over",
        composition="UPDATE deliveries SET withdrawn_attempt = 9",
    ),
    Corruption(
        "a delivery closed while it flies",
        "a closed delivery has no mission that is not over",
        composition="UPDATE deliveries SET closed_ms = 1 WHERE delivery_id = :flying",
    ),
    Corruption(
        "a flying mission set back to booked",
        "a mission that a drone has begun was accepted",
        composition="UPDATE missions SET state = 'BOOKED', body = json_set(body, '$.state',"
        " 'BOOKED') WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission in doubt that nobody was called for",
        "a mission in doubt has called an operator",
        composition="UPDATE missions SET body = json_set(body, '$.doubt', json_object('code',"
        " 'SILENT', 'detail', 'x', 'since_at', '2026-03-01T12:00:00Z'))"
        " WHERE mission_id = :flying_mission",
    ),
)

_STEPS: Final = (
    Corruption(
        "a step deleted",
        _STEPS_SENT,
        composition="DELETE FROM mission_steps WHERE mission_id = :flying_mission AND step_id = 6",
    ),
    Corruption(
        "a step to another station",
        _STEPS_SENT,
        composition="UPDATE mission_steps SET station_id = 'line-s4',"
        " step = json_set(step, '$.station_id', 'line-s4')"
        " WHERE mission_id = :flying_mission AND step_id = 7",
    ),
    Corruption(
        "a step's columns changed",
        "a step's columns say what the step says",
        composition="UPDATE mission_steps SET to_station_id = 'line-s4'"
        " WHERE mission_id = :flying_mission AND step_id = 6",
    ),
    Corruption(
        "a step ended by hand",
        _EVIDENCE,
        composition="UPDATE mission_steps SET status = 'ENDED', ended_ms = planned_end_ms"
        " WHERE mission_id = :flying_mission AND kind = 'DELIVER' AND status = 'PLANNED'",
    ),
    Corruption(
        "a step with the event of another step",
        _EVIDENCE,
        composition="UPDATE mission_steps SET event = (SELECT event FROM mission_steps"
        " WHERE mission_id = :completed_mission AND step_id = 2)"
        " WHERE mission_id = :flying_mission AND step_id = 2",
    ),
    Corruption(
        "a step set back to planned",
        "a step that is planned has no event",
        composition="UPDATE mission_steps SET status = 'PLANNED'"
        " WHERE mission_id = :flying_mission AND step_id = 2",
    ),
    Corruption(
        "a step that needs more energy than the battery has",
        _ENERGY,
        composition=_LONGER,
    ),
    Corruption(
        "a step in steps and instruction that needs more energy than the battery has",
        _ENERGY,
        composition=f"{_LONGER};"
        " UPDATE instructions SET body = json_set(body, '$.steps[' || (SELECT step_id - 1 FROM"
        f" mission_steps {_LAST}) || '].length_m', 99000.0) WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission that was planned past its deadline",
        _WINDOWS,
        composition="UPDATE missions SET request = json_set(request, '$.qos.deadline_at',"
        " '2001-01-01T00:00:00Z') WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a mission that loads before its window",
        _WINDOWS,
        composition="UPDATE missions SET request = json_set(request, '$.earliest_pickup_at',"
        " '2999-01-01T00:00:00Z') WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a cut step with other times than its event",
        "a cut step says what its event says",
        composition="INSERT INTO cut_steps SELECT mission_id, 1, step_id, kind, station_id, 5, 6,"
        " event FROM mission_steps WHERE mission_id = :flying_mission AND step_id = 2",
    ),
)

_CUSTODY: Final = (
    Corruption(
        "a link of custody deleted",
        "I6 a chain of custody has no gaps",
        composition="DELETE FROM custody WHERE delivery_id = :completed AND seq = 2",
    ),
    Corruption(
        "custody that begins elsewhere",
        "I6 a chain of custody begins at the pickup",
        composition="UPDATE custody SET custodian_id = 'line-s2'"
        " WHERE delivery_id = :flying AND seq = 1",
    ),
    Corruption(
        "a package that a station hands over",
        "I6 packages pass from station to drone and from drone to station or recipient",
        composition="UPDATE custody SET custodian_kind = 'STATION'"
        " WHERE delivery_id = :completed AND seq = 2",
    ),
    Corruption(
        "a package delivered as soon as it was loaded",
        "I6 no drone hands packages over sooner than it can fly there",
        composition="UPDATE custody SET at_ms = (SELECT at_ms + 1000 FROM custody"
        " WHERE delivery_id = :completed AND seq = 2)"
        " WHERE delivery_id = :completed AND seq = 3",
    ),
    Corruption(
        "a package delivered by a mission that never loaded it",
        "I6 packages pass from station to drone and from drone to station or recipient",
        composition="UPDATE missions SET state = 'REFUSED' WHERE delivery_id = :completed;"
        " DELETE FROM custody WHERE delivery_id = :completed AND seq = 2;"
        " UPDATE custody SET seq = 2 WHERE delivery_id = :completed AND seq = 3",
    ),
    Corruption(
        "a package delivered twice",
        "I6 a package is delivered once",
        composition="DROP INDEX custody_delivered; INSERT INTO custody SELECT delivery_id,"
        " package_id, 4, custodian_kind, custodian_id, mission_id, at_ms FROM custody"
        " WHERE delivery_id = :completed AND seq = 3",
    ),
    Corruption(
        "a package taken from its recipient",
        "I6 nothing follows the recipient",
        composition="INSERT INTO custody SELECT delivery_id, package_id, 4, custodian_kind,"
        " custodian_id, mission_id, at_ms FROM custody WHERE delivery_id = :completed AND seq = 2",
    ),
    Corruption(
        "a package delivered where nobody asked for it",
        "I6 a package is delivered at its destination, or where its mission was aimed",
        composition="UPDATE custody SET custodian_id = 'line-s2'"
        " WHERE delivery_id = :completed AND seq = 3",
    ),
    Corruption(
        "a package delivered at a wrong station in both services",
        "I6 a package is delivered at its destination, or where its mission was aimed",
        composition="UPDATE custody SET custodian_id = 'line-s2'"
        " WHERE delivery_id = :completed AND seq = 3",
        gateway="UPDATE custody SET custodian_id = 'line-s2'"
        " WHERE delivery_id = :completed AND seq = 3;"
        " UPDATE packages SET custodian_id = 'line-s2' WHERE delivery_id = :completed",
    ),
    Corruption(
        "a delivery that no drone has reported",
        "I6 a delivery in a chain of custody has a drone's event as evidence",
        composition="INSERT INTO custody SELECT delivery_id, 'p2', 3, 'RECIPIENT', 'line-s3',"
        " mission_id, at_ms FROM custody WHERE delivery_id = :flying AND seq = 3",
    ),
    Corruption(
        "a reported hand-over without custody",
        "I6 a package is handed over by one mission",
        composition="DELETE FROM custody WHERE delivery_id = :completed AND seq = 3",
    ),
    Corruption(
        "one package on board of two drones",
        "I6 a package is on board of one drone",
        composition="UPDATE drone_links SET is_occupied = 1, state = (SELECT state"
        " FROM drone_links WHERE drone_id = :flying_drone) WHERE drone_id = :silent_drone",
    ),
    Corruption(
        "two drones with custody of one package",
        "I6 the drone that has a package is the drone of its mission",
        composition="INSERT INTO custody SELECT delivery_id, package_id, 3, 'DRONE', :silent_drone,"
        " mission_id, at_ms FROM custody WHERE delivery_id = :flying AND package_id = 'p2'"
        " AND seq = 2",
    ),
    Corruption(
        "a mission completed with a package on board",
        "I6 a mission that ended well has nothing on board",
        composition="UPDATE missions SET state = 'COMPLETED', body = json_set(body, '$.state',"
        " 'COMPLETED') WHERE mission_id = :flying_mission;"
        " DELETE FROM pad_reservations WHERE mission_id = :flying_mission",
    ),
    Corruption(
        "a cancellation that released a delivered package",
        "I6 a package that a cancellation released is not delivered",
        composition="INSERT INTO cancellations VALUES (:completed, 'cnl_x',"
        " json_object('released', json_array('p1')), 1)",
    ),
    Corruption(
        "all custody of a delivery deleted",
        "I6 a package of a live mission has a chain of custody",
        composition="DELETE FROM custody WHERE delivery_id = :booked",
    ),
)

MISSION_CORRUPTIONS: Final = (*_MISSIONS, *_STEPS, *_CUSTODY)
