"""Workers: the same results here, in local processes, and on a Ray cluster of two nodes."""

import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from skyway.dispatch import optimise
from skyway.workers import NoRay, open_workers
from tests.library.dispatch.fleets import small_fleet

#: Ray leaves files open.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def no_preparation() -> None:
    """Nothing has to be loaded before tasks."""


@pytest.fixture(scope="module")
def ray_address() -> Iterator[str]:
    """A Ray cluster of two nodes on this machine, each with one processor."""
    pytest.importorskip("ray", reason="no Ray: sh tools/install.sh -r requirements-ray.txt")
    from ray.cluster_utils import Cluster

    # Ray's own limits, 30 s, are short for a machine that runs other tests too.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_raylet_start_wait_time_s", "120")
        patch.setenv("RAY_agent_register_timeout_ms", "120000")
        cluster: Any = Cluster()
        try:
            for _ in range(2):
                cluster.add_node(num_cpus=1, object_store_memory=80_000_000)
            yield cluster.address
        finally:
            cluster.shutdown()


def meet(folder: Path, number: int) -> str:
    """The node of this task, once the other task has begun too."""
    import ray

    (folder / str(number)).touch()
    while not (folder / str(1 - number)).exists():
        Event().wait(0.05)
    return str(ray.get_runtime_context().get_node_id())


@pytest.mark.long
def test_two_nodes_of_a_ray_cluster_find_the_plan_that_is_found_here(ray_address, tmp_path):
    problem = small_fleet(3, drones=3, requests=6)
    here = optimise(problem, rounds=2, searches=2)

    with open_workers(1, warm_up=no_preparation, ray_address=ray_address) as executor:
        nodes = set(executor.map(meet, [tmp_path] * 2, range(2), timeout=300))
        on_cluster = optimise(problem, rounds=2, searches=2, executor=executor)

    assert len(nodes) == 2
    assert on_cluster == here


@pytest.mark.long
def test_an_error_of_a_task_on_a_cluster_reaches_the_caller(ray_address):
    with open_workers(1, warm_up=no_preparation, ray_address=ray_address) as executor:
        future = executor.submit(int, "no number")

        with pytest.raises(ValueError, match="no number"):
            future.result()


@pytest.mark.long
def test_local_workers_find_the_plan_that_is_found_here():
    problem = small_fleet(3, drones=3, requests=6)

    with open_workers(2, warm_up=no_preparation) as executor:
        found = optimise(problem, rounds=2, searches=2, executor=executor)

    assert found == optimise(problem, rounds=2, searches=2)


def test_a_cluster_without_ray_installed_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)

    with (
        pytest.raises(NoRay, match=r"skyway\[ray\]"),
        open_workers(1, warm_up=no_preparation, ray_address="auto"),
    ):
        pass
