"""Connectors of pads: the network as a drone sees it, and the faults in documents."""

import json
import pickle
from typing import Any

import pytest

from skyway.errors import InvalidNetwork
from skyway.ids import ConnectorId, StationId
from skyway.network.geojson import read_network, write_network
from skyway.network.geojson_text import network_text, read_network_text
from skyway.network.network import Network
from skyway.network.nx import from_networkx, to_networkx
from skyway.network.pad_connectors import MOST_OF_NETWORK
from tests.library.network.test_pad_power import document


def pads_for(network: Network, connector: str | None) -> list[int]:
    """The pads of each station that a drone with this connector sees."""
    seen = network.fitting(None if connector is None else ConnectorId(connector))
    return [each.pads for each in seen.stations.values()]


@pytest.fixture
def network() -> Network:
    """Pads that fit all drones, those with a blade, and those with a blade or a pin."""
    return read_network(
        document(
            {"pads": 3},
            {"pads": 2, "pad_connectors": ["blade"], "parking": True, "pad_power_w": 400},
            {"pads": 1, "pad_connectors": ["blade", "pin"]},
        )
    )


def test_a_drone_sees_no_pads_that_do_not_fit_it(network: Network) -> None:
    assert pads_for(network, None) == pads_for(network, "blade") == [3, 2, 1]
    assert pads_for(network, "pin") == [3, 0, 1]
    assert pads_for(network, "coil") == [3, 0, 0]
    assert pads_for(network, "pin") == [3, 0, 1]


def test_the_network_of_a_connector_is_made_once_and_differs_only_in_pads(network: Network) -> None:
    seen = network.fitting(ConnectorId("pin"))

    assert seen is network.fitting(ConnectorId("pin"))
    assert seen is seen.fitting(ConnectorId("pin"))
    assert network.fitting(ConnectorId("coil")) is network.fitting(ConnectorId("hook"))
    assert (network.columns.parking, seen.columns.parking) == (frozenset({1}), frozenset())
    assert seen.columns.pads.tolist() == [3, 0, 1]
    assert seen.row_of == network.row_of
    assert seen.pad_powers is network.pad_powers


def test_what_one_drone_sees_does_not_change_what_others_see(network: Network) -> None:
    seen = network.fitting(ConnectorId("pin"))

    assert seen.fitting(None) is network
    assert pads_for(seen, "blade") == pads_for(network, "blade") == [3, 2, 1]
    assert pads_for(seen, "coil") == pads_for(network, "coil") == [3, 0, 0]


def test_a_packed_network_leaves_out_what_drones_see(network: Network) -> None:
    _ = network.outgoing, network.incoming
    size = len(pickle.dumps(network))
    network.segments_from(StationId("s0"))
    assert pads_for(network, "pin") == [3, 0, 1]

    packed = pickle.dumps(network)

    # Another thread may look at the network meanwhile, so nothing that grows is packed.
    assert len(packed) == size
    assert pads_for(pickle.loads(packed), "pin") == [3, 0, 1]


def test_connectors_survive_each_form_of_a_network(network: Network) -> None:
    for copy in (
        read_network(write_network(network)),
        read_network_text(network_text(network)),
        from_networkx(to_networkx(network)),
    ):
        assert copy == network
        assert copy.pad_connectors.of_station == {"s1": {"blade"}, "s2": {"blade", "pin"}}


@pytest.mark.parametrize(
    ("properties", "fault"),
    [
        ({"pad_connectors": "blade"}, ": 'blade' is not an array"),
        ({"pad_connectors": None}, ": null is not an array"),
        ({"pad_connectors": []}, ": 0 connectors, 1 to 8 are allowed"),
        ({"pad_connectors": [f"c{number}" for number in range(9)]}, ": 9 connectors, 1 to 8"),
        ({"pad_connectors": ["blade", 7]}, ".1: 7 is not an identifier"),
        ({"pad_connectors": ["blade 6"]}, ".0: 'blade 6' is not an identifier"),
        ({"pad_connectors": ["blade"], "pads": 0}, ": the station has no pads"),
    ],
)
def test_wrong_connectors_are_named_by_both_readers(properties: dict[str, Any], fault: str) -> None:
    wrong = document({}, properties)

    with pytest.raises(InvalidNetwork) as of_document:
        read_network(wrong)
    with pytest.raises(InvalidNetwork) as of_text:
        read_network_text(json.dumps(wrong))

    assert str(of_document.value).startswith(f"features.1.properties.pad_connectors{fault}")
    assert str(of_text.value) == str(of_document.value)


def test_a_network_with_too_many_different_connectors_is_refused() -> None:
    different = [{"pad_connectors": [f"c{number}"]} for number in range(MOST_OF_NETWORK + 1)]

    assert len(read_network(document(*different[1:])).pad_connectors.named) == MOST_OF_NETWORK
    with pytest.raises(InvalidNetwork, match="33 connectors, at most 32"):
        read_network(document(*different))
