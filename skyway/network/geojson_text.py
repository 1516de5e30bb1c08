"""Skyway networks as the text of a GeoJSON document, in and out; see `skyway.network.geojson`."""

import json

from skyway.network.collector_pause import collector_paused
from skyway.network.geojson import read_network, write_network
from skyway.network.network import Network


def read_network_text(text: str | bytes) -> Network:
    """The network that this text describes.

    Raises
    ------
    InvalidNetwork
        Names the field at fault.
    ValueError
        The text is no JSON.
    """
    with collector_paused():
        return read_network(json.loads(text))


def network_text(network: Network) -> str:
    """The GeoJSON of this network, in one line."""
    with collector_paused():
        # Made here, so without a circle to look for.
        return json.dumps(write_network(network), check_circular=False)
