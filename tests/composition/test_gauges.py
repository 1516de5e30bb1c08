"""What composition shows to Prometheus of what stands now."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import skyway_composition
import skyway_provider_registry
from skyway_composition.gauge_store import OPEN_ROWS
from skyway_composition.gauges import ALARM_CODES, CompositionGauges
from skyway_composition.tables import outbox
from sqlalchemy import or_, select

from skyway.runtime.metrics import Gauges
from tests.composition.test_alarm_routes import raise_alarm


async def shown(composition: Any) -> dict[str, dict[tuple[str, ...], float]]:
    """The numbers by name, and by the values of their labels."""
    gauges = Gauges()
    gauges.show(*CompositionGauges(composition.parts).sources())
    found: dict[str, dict[tuple[str, ...], float]] = {}
    for gauge in await gauges.read():
        found.setdefault(gauge.name, {})[tuple(gauge.labels.values())] = gauge.value
    return found


async def test_every_state_is_shown_also_without_a_mission_in_it(composition: Any) -> None:
    found = await shown(composition)

    assert found["skyway_missions"] == {
        ("QUEUED",): 0,
        ("BOOKED",): 0,
        ("ACCEPTED",): 0,
        ("ACTIVE",): 0,
    }
    assert found["skyway_missions_to_replan"] == {(): 0}
    assert found["skyway_quarantine_depth"] == {(): 0}
    assert found["skyway_planning_depth"] == {("missions",): 0}


async def test_a_booked_mission_and_its_instruction_are_counted(composition: Any) -> None:
    await composition.book()

    found = await shown(composition)

    assert found["skyway_missions"][("BOOKED",)] == 1
    assert found["skyway_outbox_depth"][("mqtt",)] == 1
    assert found["skyway_outbox_age_seconds"][("mqtt",)] >= 0.0
    assert found["skyway_outbox_depth"][("gateway",)] == 0


async def test_open_alarms_are_counted_by_level_and_code(composition: Any) -> None:
    for _ in range(2):
        await raise_alarm(composition, level="URGENT", code="BATTERY_LOW")
    alarm_id = await raise_alarm(composition, code="GEOFENCE")
    await composition("operator:op", "POST", f"/v1/alarms/{alarm_id}/acknowledgements", {})

    found = await shown(composition)

    assert found["skyway_alarms_open"] == {
        ("URGENT", "BATTERY_LOW"): 2,
        ("WARNING", "OTHER"): 0,
        ("URGENT", "OTHER"): 0,
        ("CRITICAL", "OTHER"): 0,
    }


async def test_codes_that_drones_choose_make_no_series(composition: Any) -> None:
    for number in range(5):
        await raise_alarm(composition, level="CRITICAL", code=f"CHOSEN_{number}")

    assert (await shown(composition))["skyway_alarms_open"][("CRITICAL", "OTHER")] == 5


def raised_codes() -> Iterator[str]:
    """The codes of the alarms that services raise, as their calls name them."""
    for package in (skyway_composition, skyway_provider_registry):
        for path in Path(str(package.__file__)).parent.rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if not isinstance(node, ast.Call):
                    continue
                called = ast.unparse(node.func).rpartition(".")[2]
                for given in node.keywords:
                    if (
                        called in ("raise_alarm", "_raise_alarm", "DroneAlarm")
                        and given.arg == "code"
                        and isinstance(given.value, ast.Constant)
                    ):
                        yield str(given.value.value)


def test_every_alarm_of_the_services_has_a_series_of_its_own() -> None:
    raised = set(raised_codes())

    assert len(raised) > 8
    assert raised <= ALARM_CODES


async def test_loops_rest_only_while_no_mission_is_open(composition: Any) -> None:
    open_row = select(or_(*OPEN_ROWS))
    async with composition.parts.db.read() as connection:
        assert not (await connection.execute(open_row)).scalar_one()

    await composition.book()
    async with composition.parts.db.write() as tx:
        await tx.execute(outbox.delete())

    async with composition.parts.db.read() as connection:
        assert (await connection.execute(open_row)).scalar_one()
