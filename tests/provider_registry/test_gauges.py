"""What the registry shows to Prometheus of what stands now."""

from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

from skyway_provider_registry.gauges import RegistryGauges
from skyway_provider_registry.presence.follow import Recorder
from skyway_provider_registry.telemetry.keep_telemetry import TelemetryRecorder

from skyway.contracts.topics import CONNECTION, STATE
from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock
from skyway.runtime.metrics import Gauges
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database

Maker = Callable[..., Any]


async def shown(
    recorder: TelemetryRecorder, db: Database, clock: ManualClock, folder: Path = Path("nowhere")
) -> dict[Any, float]:
    gauges = Gauges()
    gauges.show(*RegistryGauges(db, clock, recorder, folder / "passwords").sources())
    return {(each.name, *each.labels.values()): each.value for each in await gauges.read()}


async def test_drones_are_counted_by_state(
    api: Any, db: Database, clock: ManualClock, online: Maker, state: Maker
) -> None:
    provider_id = await api.provider()
    drone_id = (await api.drone(provider_id))["drone_id"]
    await api.drone(provider_id)
    ids = (provider_id, drone_id)
    said = [
        Received(CONNECTION, ids, online(7, 1), False),
        Received(STATE, ids, state(7, 1), False),
    ]
    clock.advance(timedelta(seconds=2))
    await Recorder(db, clock).record(said)

    found = await shown(TelemetryRecorder(db, clock), db, clock)

    assert found["skyway_drones", "AVAILABLE"] == 1
    assert found["skyway_drones", "REGISTERED"] == 1
    assert found["skyway_drones", "ON_MISSION"] == 0
    assert found[("skyway_drone_lag_max_seconds",)] == 2.0


async def test_telemetry_is_as_old_as_its_newest_sample(
    db: Database, clock: ManualClock, sample: Maker
) -> None:
    recorder = TelemetryRecorder(db, clock)
    assert ("skyway_telemetry_age_seconds",) not in await shown(recorder, db, clock)

    newer, older = sample(7, 2), sample(7, 1, later_s=-3.0)
    recorder.accept([(DroneId("drn_1"), newer), (DroneId("drn_2"), older)])
    clock.advance(timedelta(seconds=4))

    found = await shown(recorder, db, clock)
    assert found[("skyway_telemetry_age_seconds",)] == 4.0
    assert found[("skyway_telemetry_depth",)] == 2


async def test_logins_that_the_embedded_broker_refused_are_shown(
    db: Database, clock: ManualClock, tmp_path: Path
) -> None:
    recorder = TelemetryRecorder(db, clock)
    before = await shown(recorder, db, clock, tmp_path)

    (tmp_path / "refused_logins").write_text("7\n")

    found = await shown(recorder, db, clock, tmp_path)
    assert ("skyway_broker_logins_refused",) not in before
    assert found[("skyway_broker_logins_refused",)] == 7
