"""Clients with a seal sign all that they publish, their last will too, on both brokers."""

from skyway.contracts.topics import ACKS, CONNECTION, INSTRUCTIONS
from skyway.runtime.signing.key_pair import PrivateKey, is_signed_by, public_key_bytes
from skyway.runtime.signing.seal import CloudSeal, DroneSeal
from tests.signing_files import PUBLIC_KEYS, SIGNING_KEYS

KEY = PrivateKey(b"d" * 32)


async def test_a_drone_signs_what_it_says_and_its_last_will(
    broker, connect, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION, ACKS)
    await all_connected(composition)
    drone = await connect(
        broker.port,
        "p/drone-1",
        will=lambda: (CONNECTION("p", "drone-1"), make.connection(1, "LOST")),
        seal=DroneSeal(KEY, PUBLIC_KEYS),
    )
    await all_connected(drone)
    await drone.publish(CONNECTION("p", "drone-1"), make.connection(1))
    await drone.publish(ACKS("p", "drone-1"), make.ack(1))
    drone.drop()

    received = await receive(arrived, 3)
    public_key = public_key_bytes(KEY.public_key)
    assert [getattr(one.message, "status", None) for one in received][-1] == "LOST"
    assert [one.topic for one in received] == [CONNECTION, ACKS, CONNECTION]
    for one in received:
        assert is_signed_by(public_key, one.topic(*one.ids).name, one.payload)


async def test_a_drone_reads_what_composition_has_signed_and_nothing_else(
    broker, connect, make, receive, all_connected, until
):
    seal = DroneSeal(KEY, PUBLIC_KEYS)
    drone = await connect(broker.port, "p/drone-1", seal=seal)
    arrived = drone.batches(INSTRUCTIONS("p", "drone-1"))
    own = CloudSeal(SIGNING_KEYS["composition"])
    composition = await connect(broker.service_port, "composition", seal=own)
    forger = await connect(broker.service_port, "composition", client_id="forger")
    unknown = await connect(
        broker.service_port, "composition", client_id="unknown", seal=CloudSeal(PrivateKey.new())
    )
    await all_connected(drone, composition, forger, unknown)

    await forger.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(7))
    await unknown.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(8))
    await until(lambda: seal.refused == 2)
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(1))

    (received,) = await receive(arrived, 1)
    assert received.message.seq == 1
