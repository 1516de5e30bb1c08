"""Every `code` of a 409 answer, and what it means."""

from collections.abc import Mapping
from typing import Final

CONFLICT_CODES: Final[Mapping[str, str]] = {
    "ALREADY_CALLED_HOME": "The drone is on its way home already.",
    "ALREADY_CONFIRMED": "The loading of this mission was confirmed before.",
    "ALREADY_HELD": "The mission is held already.",
    "BEING_LOADED": "The loading was just confirmed; the drone must answer first.",
    "HELD": "The mission is held; resume it first.",
    "MISSION_OVER": "The mission is over.",
    "MODEL_IN_USE": "Registered drones are of this model; use another model id.",
    "NAMED_MODEL": "The model is one of Skyway's own and cannot be replaced.",
    "NOTHING_ON_BOARD": "The drone carries nothing that it could bring home.",
    "NOT_HELD": "The mission is not held.",
    "NOT_IN_DOUBT": "Only a mission in doubt can be given up.",
    "NOT_LOADING": "The drone does not wait at the pickup for its packages.",
    "NO_NETWORK": "No network is published: skyway network import bundled.",
    "NOT_YET": "An earlier report is missing; send this report again later.",
    "ON_MISSION": "The drone is on a mission.",
    "QUOTE_EXPIRED": "The offer is no longer valid; ask for another quote.",
    "QUOTE_TAKEN": "Another offer of this quote was accepted before.",
    "REGISTRATION_TAKEN": "Another drone of this provider has this registration.",
    "REPLANNING": "The drone has not answered its new plan yet.",
    "STATION_ELSEWHERE": "A station id belongs to another network.",
    "STATION_RESERVED": "Drones have reserved pads that this network no longer has.",
    "TOKEN_EXPIRED": "The enrolment token is too old; have another one made.",
    "TOKEN_USED": "The enrolment token was used before.",
    "TOO_LATE": "Nothing of this can be stopped any more.",
    "WEBHOOK_DISABLED": "The webhook is disabled; make it active first.",
}
