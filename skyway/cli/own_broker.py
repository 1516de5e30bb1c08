"""Whether a local system starts a broker of its own, or meets the one that is named."""

import os

#: keys.env says with it that the broker of its `SKYWAY_MQTT_URL` runs only while the system does.
#: A shell that sourced keys.env names no other broker to the next `skyway up`.
OWN_BROKER_URL = "SKYWAY_OWN_MQTT_URL"


def named_broker() -> str | None:
    """The address of the broker that somebody else runs; None when it is ours to start."""
    url = os.environ.get("SKYWAY_MQTT_URL")
    return None if url == os.environ.get(OWN_BROKER_URL) else url
