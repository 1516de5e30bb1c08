"""Between the missions that fly a delivery and their rows."""

from skyway.contracts.mission import MissionReport
from skyway.runtime.sql.connection import AnyRow
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.delivery import FlownMission
from skyway_gateway.deliveries.rows.values import Values


def mission_row(mission: FlownMission) -> Values:
    """The row of a mission of which nothing was reported yet."""
    return {
        "mission_id": mission.mission_id,
        "delivery_id": mission.delivery_id,
        "attempt": mission.attempt,
        "trip": mission.trip,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
        "report_seq": 0,
        "price_amount": mission.price.amount,
        "currency": mission.price.currency,
        "start_ms": moment_to_ms(mission.start_at),
        **_changing(mission),
    }


def _changing(mission: FlownMission) -> Values:
    """The columns of a mission that change during its life."""
    return {"state": mission.state, "body": mission.model_dump_json()}


def mission_changes(before: FlownMission, after: FlownMission) -> Values:
    """The columns in which a mission differs: while its plan holds, its state alone."""
    if after.model_copy(update={"state": before.state}) == before:
        return {"state": after.state}
    return _changing(after)


def mission_of(row: AnyRow) -> FlownMission:
    """The mission in a row."""
    return FlownMission.read(row.body).model_copy(update={"state": row.state})


def reported(report: MissionReport) -> Values:
    """What a mission's row keeps of a report: its place, times up to a hand-over, its end."""
    flown = report.data.get("flown", {}) if report.kind == "DELIVERED" else {}
    names = ("flight_s", "waiting_s", "recharging_s")
    ended = {"ended_ms": moment_to_ms(report.at)} if report.kind == "ENDED" else {}
    times = {name: flown[name] for name in names if name in flown}
    return {"report_seq": report.seq, **times, **ended}
