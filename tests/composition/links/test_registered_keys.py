"""The registry's answer about keys also names which composition serves each drone."""

from types import SimpleNamespace
from typing import Any

from skyway_composition.links.registered_keys import RegisteredKeys
from skyway_composition.own_cells import OwnCells

from skyway.contracts.drones import DroneSignature, DroneSignatures
from skyway.ids import DroneId, NetworkId

ROW = NetworkId("row")


async def test_the_first_keys_show_which_drones_are_of_other_cells() -> None:
    async def call(*_: object, **__: object) -> DroneSignatures:
        found = DroneSignature(drone_id=DroneId("drn_1"), is_signed=False, network_id=ROW)
        return DroneSignatures(signatures=(found,))

    own = OwnCells({ROW: "http://others"}, "http://ours", "http://ours")
    registry: Any = SimpleNamespace(call=call)

    await RegisteredKeys(registry, own).of([DroneId("drn_1")])

    assert own.is_foreign("drn_1")
