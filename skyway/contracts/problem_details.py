"""The body of every error answer (RFC 9457 problem details), and the codes of a 409 answer."""

from collections.abc import Mapping
from typing import Annotated, Final

from pydantic import ConfigDict, Field

from skyway.json_model import JsonModel

#: The media type of a problem document (RFC 9457, section 3).
PROBLEM_MEDIA_TYPE = "application/problem+json"

CONFLICT_CODES: Final[Mapping[str, str]] = {
    "ALREADY_CALLED_HOME": "The drone is on its way home already.",
    "ALREADY_CONFIRMED": "The loading of this mission was confirmed before.",
    "ALREADY_HELD": "The mission is held already.",
    "BATTERY_INSTALLED": "The battery is in a drone; remove it there first.",
    "BEING_LOADED": "The loading was just confirmed; the drone must answer first.",
    "CHANGED_MEANWHILE": "Another call has changed it meanwhile, or it was booked; try again.",
    "HELD": "The mission is held; resume it first.",
    "MISSION_OVER": "The mission is over.",
    "MISSION_QUEUED": "The mission was not sent to its drone yet.",
    "MODEL_IN_USE": "Registered drones are of this model; use another model id.",
    "NAMED_MODEL": "The model is one of Skyway's own and cannot be replaced.",
    "NOTHING_ON_BOARD": "The drone carries nothing that it could bring home.",
    "NOT_HELD": "The mission is not held.",
    "NOT_IN_DOUBT": "Only a mission in doubt can be given up.",
    "NOT_LOADING": "The drone does not wait at the pickup for its packages.",
    "NO_SMALL_WORLD": "Only `skyway up` starts a small world.",
    "NO_OFFER": "The provider of the accepted offer cannot fly the changed request; see `reasons`.",
    "NO_NETWORK": "No network is published: skyway network import bundled.",
    "NOT_YET": "An earlier report is missing; send this report again later.",
    "OFFER_LOST": "The offer cannot be kept any more; `next_offer` is the next best one.",
    "ON_MISSION": "The drone is on a mission.",
    "OTHER_CELL": "Another server serves the new home; remove the drone and register it again.",
    "OTHER_MODEL": "The battery fits drones of another model.",
    "OTHERS_MODEL": "Somebody else added this model; use another model id.",
    "PAYLOAD_CUT": "Only the begin of this message was kept, so it cannot be handled.",
    "QUOTE_EXPIRED": "The offer is no longer valid; ask for another quote.",
    "QUOTE_TAKEN": "Another offer of this quote was accepted before.",
    "PROVIDER_SUSPENDED": "An operator has suspended the provider, so it registers no drones.",
    "REGISTRATION_TAKEN": "Another drone of this provider has this registration.",
    "REPLANNING": "The drone has not answered its new plan yet.",
    "SERIAL_TAKEN": "Another battery of this provider has this serial number.",
    "SHARED_TRIP": "Packages of other deliveries fly on this trip, so it stays as it is.",
    "STATION_ELSEWHERE": "A station id belongs to another network.",
    "STATION_RESERVED": "Drones have reserved pads that this network no longer has.",
    "STILL_NOT_TAKEN": "The message still cannot be taken; it stays in the quarantine.",
    "TOKEN_EXPIRED": "The enrolment token is too old; have another one made.",
    "TOKEN_USED": "The enrolment token was used before.",
    "TOO_MANY_BATTERIES": "The provider has as many batteries as it may have.",
    "TOO_MANY_DELIVERIES": "The customer has as many deliveries as it may have at one time.",
    "TOO_MANY_DRONES": "The provider would have more drones than it may have.",
    "TOO_MANY_KEYS": "As many keys of this subject are in use as may be: delete one first.",
    "TOO_MANY_MODELS": "The provider has added as many drone models as it may.",
    "TOO_MANY_ROTATIONS": "Three replaced secrets still sign; use the newest secret.",
    "TOO_MANY_SCHEDULED": "The customer has as many SCHEDULED deliveries as it may have.",
    "TOO_MANY_WEBHOOKS": "The customer has as many webhooks as it may have.",
    "TOO_MANY_HOLDS": "As many quotes are held as the customer may hold at the same time.",
    "TOO_LATE": "Nothing of this can be stopped or changed any more.",
    "WEBHOOK_DISABLED": "The webhook is disabled; make it active first.",
}


class FieldProblem(JsonModel):
    """One field at fault; `field` is its path in the caller's own JSON: ``packages.0.mass_kg``."""

    model_config = ConfigDict(extra="ignore")

    field: Annotated[
        str,
        Field(
            description="The path of the field in the caller's JSON, such as packages.0.mass_kg."
        ),
    ]
    detail: Annotated[str, Field(description="What is wrong with it.")]


class ProblemDetails(JsonModel):
    """What went wrong; `type` is stable, `code` says more within it, other members may be added."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "examples": [
                {
                    "type": "urn:skyway:problem:invalid-input",
                    "title": "The request breaks a limit",
                    "status": 422,
                    "detail": "packages.0.mass_kg: must be at least 0",
                    "errors": [
                        {
                            "field": "packages.0.mass_kg",
                            "detail": "must be at least 0",
                        }
                    ],
                    "trace_id": "4bf92f3577b34da6a3ce929d0e0e4736",
                }
            ]
        },
    )

    type: Annotated[str, Field(description="urn:skyway:problem:<name>, stable")] = "about:blank"
    title: Annotated[str, Field(description="What the type means.")]
    status: Annotated[int, Field(ge=100, le=599, description="The HTTP status, 100 to 599.")]
    detail: Annotated[str | None, Field(description="What went wrong this time.")] = None
    code: Annotated[str | None, Field(description="UPPER_SNAKE, stable within the type")] = None
    errors: Annotated[tuple[FieldProblem, ...], Field(description="each field at fault")] = ()
    trace_id: Annotated[str | None, Field(description="finds the request in our logs")] = None
