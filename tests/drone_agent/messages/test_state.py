"""The state shows the results of the analysis, and what the drone does by itself."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.analysis.analysis import Analysis
from skyway_drone_agent.failsafes.failsafe import active_failsafe
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.link.uplink import Envelope
from skyway_drone_agent.messages.state import snapshot_of
from skyway_drone_agent.simulated.disturbances import UNDISTURBED, changed
from skyway_lab.benchmarks.telemetry_thinning.flown import START, Flown
from skyway_lab.benchmarks.telemetry_thinning.round_trip import round_trip

from skyway.contracts.drone_report import ActiveFailsafe, DroneState, Failsafe, Fault
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.ids import DroneId, StationId

ENVELOPE = Envelope(message_id="msg_1", sent_at=START, session=1, seq=1)


def flying(**changes: Any) -> tuple[Logbook, DroneState]:
    """A drone in a west wind, ten minutes after the start."""
    model = DJI_MATRICE_300_RTK
    disturbed = changed(UNDISTURBED, {"wind": {"mean_mps": 5.0, "from_deg": 270.0}})
    plan = Flown(model, round_trip(model, start_at=START), disturbed, drone_id=DroneId("drn_1"))
    analysis = Analysis(model)
    for moment in plan.moments(every_s=10.0):
        found = analysis.assess(moment.reading, moment.logbook)
        if moment.reading.at >= START + timedelta(minutes=10):
            break
    logbook = moment.logbook.model_copy(update=changes)
    return logbook, snapshot_of(logbook, found, envelope=ENVELOPE)


def test_the_state_shows_the_results_of_the_analysis() -> None:
    _, state = flying()

    assert state.health is not None
    assert state.health.wind is not None
    assert state.health.wind.east_mps == pytest.approx(5.0)
    assert state.health.wind.north_mps == pytest.approx(0.0, abs=1e-9)
    assert state.health.range_m > 10_000
    assert set(state.health.safe_landings) == {"home", "north", "east", "south"}
    assert DroneState.model_validate_json(state.model_dump_json()) == state


def test_the_state_lists_faults_with_the_most_dangerous_first() -> None:
    _, state = flying(faults=(Fault.LINK_LOST, Fault.BATTERY_LOW))

    assert state.faults == (Fault.BATTERY_LOW, Fault.LINK_LOST)


def test_a_drone_that_has_landed_away_from_every_station_is_down() -> None:
    _, state = flying(is_down=True)

    assert state.activity == "DOWN"


def test_no_failsafe_is_reported_for_a_mere_warning() -> None:
    logbook, _ = flying(faults=(Fault.BATTERY_LOW,))

    assert active_failsafe(logbook) is None


def test_a_drone_without_a_link_says_where_it_will_land() -> None:
    logbook, _ = flying(faults=(Fault.LINK_LOST,))

    assert active_failsafe(logbook) == ActiveFailsafe(
        fault=Fault.LINK_LOST, failsafe=Failsafe.LAND_AT_NEXT, station_id=StationId("east")
    )
