"""Links to tracking pages: unguessable, made from the delivery's id and a key of the deployment.

Nothing is stored for a link before its customer renews or withdraws it.
"""

import hmac
from base64 import urlsafe_b64encode
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from skyway.ids import DeliveryId
from skyway.runtime.peer_secrets import read_secret

#: The first link of a delivery has this number; each renewal counts up.
FIRST_LINK: Final = 1

#: How the paths of tracking pages begin.
TRACKING_PATHS: Final = "/track/"

#: 192 bits, so that nobody finds a link by trying.
_TOKEN_BYTES: Final = 24


@dataclass(frozen=True)
class TrackingLinks:
    """Makes and recognises links, which begin as `public_url`."""

    secrets_dir: Path
    public_url: str

    def url_of(self, delivery_id: DeliveryId, *, number: int) -> str:
        """The link with this number."""
        base = self.public_url.rstrip("/")
        return f"{base}{TRACKING_PATHS}{delivery_id}/{self._token(delivery_id, number)}"

    def is_genuine(self, delivery_id: DeliveryId, token: str, *, number: int) -> bool:
        """Whether this is the token of the link with this number, compared in constant time."""
        return hmac.compare_digest(self._token(delivery_id, number).encode(), token.encode())

    def _token(self, delivery_id: DeliveryId, number: int) -> str:
        about = f"skyway tracking {delivery_id} {number}".encode()
        digest = hmac.digest(self._key, about, "sha256")
        return urlsafe_b64encode(digest[:_TOKEN_BYTES]).decode()

    @cached_property
    def _key(self) -> bytes:
        return read_secret(self.secrets_dir, "tracking_key").encode()
