"""The table of what idle drones bring to requests that wait."""

from skyway_lab.benchmarks.dispatch.idle_drones import idle_drones
from skyway_lab.experiments.fleet_hour.cases import Load


def test_an_hour_is_flown_with_and_without_idle_drones() -> None:
    [table] = idle_drones([("city", Load(4, 8))], seeds=[1])

    [(case, without, idle_too)] = table.rows
    assert case == "city, 4 drones, 8 requests"
    assert float(idle_too.split()[0]) <= float(without.split()[0])
