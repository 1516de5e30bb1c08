"""Which messages of a link with several senders count for the drone."""

import logging
from types import SimpleNamespace
from typing import Any

import pytest
from skyway_drone_agent.mavlink.link import MavlinkLink

QUADROTOR, TRACKER, ROVER, GROUND_STATION, COMPANION, GIMBAL = 2, 5, 10, 6, 18, 26
ARDUPILOT, NO_AUTOPILOT = 3, 8


@pytest.fixture(scope="module")
def dialect() -> Any:
    pytest.importorskip("pymavlink")
    from pymavlink.dialects.v20 import common

    return common


class Link:
    """A link whose messages come from a list."""

    def __init__(self, dialect: Any, system_id: int | None = None) -> None:
        self._dialect = dialect
        self._arriving: list[Any] = []
        mav = SimpleNamespace(srcSystem=1, srcComponent=191)
        connection = SimpleNamespace(
            mav=mav, recv_msg=lambda: self._arriving.pop(0) if self._arriving else None
        )
        clock: Any = SimpleNamespace()
        self.link = MavlinkLink(connection, dialect, clock, system_id=system_id)
        self.passed_on: list[Any] = []
        self.link.listen(self.passed_on.append)

    def arrive(self, source: tuple[int, int], kind: str, *values: Any) -> None:
        message = getattr(self._dialect, f"MAVLink_{kind}_message")(*values)
        message._header.srcSystem, message._header.srcComponent = source
        self._arriving.append(message)
        self.link.read()

    def beat(self, source: tuple[int, int], kind: int, autopilot: int) -> None:
        self.arrive(source, "heartbeat", kind, autopilot, 0, 0, 4, 3)

    async def target(self) -> tuple[int, int]:
        return await self.link.target()


@pytest.mark.parametrize(
    ("kind", "autopilot"),
    [
        (GIMBAL, NO_AUTOPILOT),
        (GIMBAL, 0),
        (COMPANION, NO_AUTOPILOT),
        (GROUND_STATION, NO_AUTOPILOT),
        (TRACKER, ARDUPILOT),
        (ROVER, ARDUPILOT),
    ],
)
async def test_the_first_autopilot_of_an_aircraft_is_the_drones(
    dialect: Any, kind: int, autopilot: int
) -> None:
    link = Link(dialect)
    link.beat((7, 154), kind, autopilot)
    link.beat((7, 1), QUADROTOR, ARDUPILOT)

    assert await link.target() == (7, 1)
    assert link.link.mav.srcSystem == 7


async def test_a_second_autopilot_is_reported_once_and_ignored(
    dialect: Any, caplog: pytest.LogCaptureFixture
) -> None:
    link = Link(dialect)
    with caplog.at_level(logging.INFO):
        for _ in range(3):
            for system in (7, 8):
                link.beat((system, 1), QUADROTOR, ARDUPILOT)
                link.arrive((system, 1), "extended_sys_state", 0, system - 6)

    assert await link.target() == (7, 1)
    states = [one.landed_state for one in link.passed_on if one.get_type() == "EXTENDED_SYS_STATE"]
    assert states == [1, 1, 1]
    reported = [one for one in caplog.records if one.levelname == "WARNING"]
    assert [(one.msg, vars(one)["system"]) for one in reported] == [
        ("another autopilot on the link is ignored: see --system-id", 8)
    ]


async def test_a_named_system_is_the_drones_whichever_sends_first(dialect: Any) -> None:
    link = Link(dialect, system_id=8)
    link.beat((7, 1), QUADROTOR, ARDUPILOT)
    link.beat((8, 1), QUADROTOR, ARDUPILOT)

    assert await link.target() == (8, 1)


async def test_messages_of_another_component_do_not_count(dialect: Any) -> None:
    link = Link(dialect)
    link.beat((7, 1), QUADROTOR, ARDUPILOT)
    link.arrive((7, 180), "extended_sys_state", 0, 2)

    assert [one.get_type() for one in link.passed_on] == ["HEARTBEAT"]


async def test_answers_to_another_ground_station_do_not_count(dialect: Any) -> None:
    link = Link(dialect)
    link.beat((7, 1), QUADROTOR, ARDUPILOT)
    gripper, accepted = 211, 0
    with link.link.receiving("COMMAND_ACK", "MISSION_ACK") as answers:
        link.arrive((7, 1), "command_ack", gripper, accepted, 0, 0, 255, 190)
        link.arrive((7, 1), "command_ack", gripper, accepted, 0, 0, 7, 190)
        link.arrive((7, 1), "mission_ack", 255, 190, accepted)
        link.arrive((7, 1), "command_ack", gripper, accepted, 0, 0, 7, 191)
        link.arrive((7, 1), "command_ack", gripper, accepted, 0, 0, 0, 0)
        link.arrive((7, 1), "mission_ack", 7, 191, accepted)

        found = [await answers.next(0) for _ in range(3)]
        assert answers._queue.empty()

    assert [one.get_type() for one in found if one] == ["COMMAND_ACK"] * 2 + ["MISSION_ACK"]
