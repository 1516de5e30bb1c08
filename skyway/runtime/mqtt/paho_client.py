"""A paho client for one connection: who logs in, and what the broker says when it is lost."""

from dataclasses import dataclass, field

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from skyway.runtime.mqtt.buffered_socket import BufferedSocket


@dataclass(frozen=True, slots=True)
class RawMessage:
    """A topic name and a payload as they go over the wire."""

    name: str
    payload: bytes
    mqtt_qos: int
    retained: bool


@dataclass(frozen=True, slots=True)
class Login:
    """How a client introduces itself."""

    client_id: str
    user_name: str
    password: str = field(repr=False)
    keepalive_s: int


class PahoClient(Client):
    """A paho client on a socket that asyncio has already connected (paho's own connect blocks)."""

    opened: BufferedSocket

    def _create_socket(self) -> BufferedSocket:
        return self.opened


def new_paho_client(login: Login, will: RawMessage | None) -> PahoClient:
    """A client that has not connected, and never connects again by itself."""
    paho = PahoClient(CallbackAPIVersion.VERSION2, login.client_id, reconnect_on_failure=False)
    paho.username_pw_set(login.user_name, login.password)
    paho.max_inflight_messages = 0
    if will is not None:
        paho.will_set(will.name, will.payload, will.mqtt_qos, will.retained)
    return paho
