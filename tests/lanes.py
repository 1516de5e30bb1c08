"""Which test process runs which tests: whole systems beside tests that only compute."""

import pytest
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

#: The folders whose tests start whole systems.
_SYSTEMS = ("tests/end_to_end/", "tests/verification/")

#: These tests need a programme that takes seconds to compile: one process compiles it for all.
_COMPILED = ("tests/library/planner/exact/", "tests/library/planner/test_windows.py")

#: The longest of these tests and shared systems, in the order of their length. What begins last
#: should be short, because the other processes have nothing to do while it runs.
_LONGEST = (
    "[embedded-60]",
    "[embedded-60-trouble]",
    "[embedded-900]",
    "test_hostile.py",
    "[postgresql-mosquitto-900]",
    "test_chaos.py",
    "[postgresql-mosquitto-60]",
    "test_demo.py",
    "test_small_world.py",
)


def begins_with_systems(worker: str, *, workers: int) -> bool:
    """Whether this process (gw0, gw1, ...) runs whole systems first, as half of all do.

    Tests of whole systems mostly wait. If all processes ran them first, the processors would have
    little to do at first, and too much afterwards.
    """
    return 2 * int(worker.removeprefix("gw")) < workers


def starts_system(scope: str) -> bool:
    """Whether the tests that stay together under this name need a whole system."""
    return scope.startswith(_SYSTEMS)


def rank(item: pytest.Item) -> tuple[bool, int]:
    """Sorts tests: those of whole systems first, the longest of them before all others."""
    starts = item.get_closest_marker("end_to_end") is not None
    places = (place for place, each in enumerate(_LONGEST) if each in item.nodeid)
    return (not starts, next(places, len(_LONGEST)))


class LaneScheduling(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    """Gives all tests of one running system, or of one file, to the same process.

    All tests that need the same compiled programme are given to one process too.

    xdist's own groups do not work with this version of pytest, because they change test ids.
    """

    def _split_scope(self, nodeid: str) -> str:
        if nodeid.startswith(_COMPILED):
            return _COMPILED[0]
        file, _, name = nodeid.partition("::")
        _, _, system = name.rstrip("]").partition("[")
        folder = file.rpartition("/")[0]
        return f"{folder}/[{system}]" if "/end_to_end/" in file and system else file

    def _assign_work_unit(self, node: WorkerController) -> None:
        """Give a process the next tests of its kind, or of the other kind if none is left."""
        systems = begins_with_systems(node.gateway.id, workers=self.numnodes)
        own = (scope for scope in self.workqueue if starts_system(scope) == systems)
        scope = next(own, None)
        if scope is not None:
            self.workqueue.move_to_end(scope, last=False)
        super()._assign_work_unit(node)
