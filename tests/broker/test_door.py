"""How many connections there may be, in all and of one address."""

from skyway_broker.door import Door
from skyway_broker.limits import Limits

from skyway.runtime.limits import Budget


class Connection:
    def __init__(self) -> None:
        self.is_aborted = False

    def abort(self) -> None:
        self.is_aborted = True


def make_door(*, burst: int = 100, connections: int = 6, per_address: int = 4) -> Door:
    budget = Budget("ADDRESS_CONNECTS", per_s=1.0, burst=burst)
    limits = Limits(
        connections=connections,
        connections_per_address=per_address,
        connects_per_address=budget,
    )
    return Door(limits, now=lambda: 0.0)


def test_connections_of_one_address_are_limited():
    door = make_door()
    inside = [Connection() for _ in range(4)]
    for each in inside:
        assert door.enter(each, "here")
        door.introduce(each)

    assert not door.enter(Connection(), "here")
    assert door.enter(Connection(), "there")
    door.leave(inside[0])
    assert door.enter(Connection(), "here")


def test_all_addresses_together_have_so_many_connections():
    door = make_door(connections=2)
    for address in ("one", "two"):
        connection = Connection()
        assert door.enter(connection, address)
        door.introduce(connection)

    assert not door.enter(Connection(), "three")


def test_the_longest_silent_connection_makes_room_for_the_next():
    door = make_door()
    silent = [Connection() for _ in range(4)]
    for number, each in enumerate(silent):
        assert door.enter(each, f"address {number}")

    assert [each.is_aborted for each in silent] == [True, False, False, False]


def test_an_address_has_so_many_connections_a_second():
    door = make_door(burst=3, connections=100, per_address=100)

    entered = [door.enter(Connection(), "here") for _ in range(4)]

    assert entered == [True, True, True, False]
    assert door.enter(Connection(), "there")


def test_a_fleet_of_5000_connects_from_one_address():
    door = Door(Limits(), now=lambda: 0.0)

    for _ in range(5_000):
        connection = Connection()
        assert door.enter(connection, "one address")
        door.introduce(connection)
