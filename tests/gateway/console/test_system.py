"""GET /v1/system: operators see how each service is, and a silent service is named."""

import logging
from pathlib import Path

from skyway_gateway.console.system_routes import SmallWorld

from skyway.contracts.figures import FIGURES, Figure, Figures
from skyway.runtime.http.metrics_routes import figures_of
from skyway.runtime.metrics import Gauge, count
from skyway.runtime.tracing import LAST_ERRORS
from tests.gateway.whole_gateway import Gateway


async def test_only_operators_see_the_system(gateway: Gateway) -> None:
    for key, status in ((gateway.operator, 200), (gateway.customer, 403)):
        answer = await gateway.http.get("/v1/system", headers=key)

        assert answer.status_code == status, answer.text


async def test_services_that_say_something_else_are_not_answering(gateway: Gateway) -> None:
    """The fake peers answer this call with an empty object."""
    answer = await gateway.http.get("/v1/system", headers=gateway.operator)

    services = {each["service"]: each for each in answer.json()["services"]}
    assert {name: each["is_answering"] for name, each in services.items()} == {
        "gateway": True,
        "registry": False,
        "composition": False,
    }
    names = {figure["name"] for figure in services["gateway"]["figures"]}
    assert {"process_cpu_seconds_total", "process_resident_memory_bytes"} <= names
    assert services["registry"]["last_errors"] == []
    assert FIGURES in {forwarded.path for forwarded in gateway.forwarded}


async def test_processes_that_are_not_counted_are_named(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both

    answer = await gateway.http.get("/v1/system", headers=gateway.operator)

    expected = {
        "sqlite": ["BROKER"],
        "postgresql": ["BROKER", "DATABASE_SERVER", "OTHER_REPLICAS"],
    }
    assert answer.json()["not_counted"] == expected[gateway.parts.db.dialect]


async def test_a_small_world_is_requested_where_skyway_up_waits_for_it(
    gateway: Gateway, tmp_path: Path
) -> None:
    foreign = await gateway.http.post("/v1/small-world", headers=gateway.customer)
    elsewhere = await gateway.http.post("/v1/small-world", headers=gateway.operator)
    assert (foreign.status_code, elsewhere.json()["code"]) == (403, "NO_SMALL_WORLD")
    system = await gateway.http.get("/v1/system", headers=gateway.operator)
    assert system.json()["small_world"] == "UNAVAILABLE"

    small_world = SmallWorld(tmp_path / "requested")
    states = [small_world.state]
    for _ in range(2):
        small_world.request()
        states.append(small_world.state)
    assert states == ["AVAILABLE", "REQUESTED", "REQUESTED"]


def test_figures_are_counters_sums_and_gauges_without_buckets() -> None:
    count("skyway_tests", "counted in a test", 3, what="figures")
    gauge = Gauge("skyway_queue_depth", "what waits", 7.0, {"queue": "booking"})

    figures = figures_of([gauge])

    assert isinstance(figures, Figures)
    assert Figure(name="skyway_queue_depth", labels={"queue": "booking"}, value=7.0) in (
        figures.figures
    )
    counted = [each for each in figures.figures if each.name == "skyway_tests_total"]
    assert [(each.labels, each.value) for each in counted] == [({"what": "figures"}, 3.0)]
    assert not [each for each in figures.figures if each.name.endswith(("_bucket", "_created"))]


def test_figures_name_the_last_errors() -> None:
    log = logging.getLogger("skyway.test_system")
    log.addHandler(LAST_ERRORS)
    log.warning("the roof leaks")
    log.removeHandler(LAST_ERRORS)

    assert "the roof leaks" in [each.event for each in figures_of([]).last_errors]
