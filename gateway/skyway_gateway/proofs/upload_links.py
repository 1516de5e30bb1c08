"""Addresses for the photos of hand-overs: unguessable, each for one package of one delivery.

As with tracking links, nothing is stored for an address.
"""

import hmac
from base64 import urlsafe_b64encode
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from skyway.delivery.request import DeliveryRequest, Package
from skyway.ids import DeliveryId, PackageId
from skyway.runtime.peer_secrets import read_secret

#: How the paths of uploads begin.
UPLOAD_PATHS: Final = "/v1/proofs/uploads/"

#: 192 bits, so that nobody finds an address by trying.
_MAC_BYTES: Final = 24


@dataclass(frozen=True)
class UploadLinks:
    """Makes and recognises the addresses."""

    secrets_dir: Path

    def added_to(self, request: DeliveryRequest, delivery_id: DeliveryId) -> DeliveryRequest:
        """The request for composition: each package that needs a photo has its address."""
        packages = tuple(self._with_path(request.packages, delivery_id))
        return request.model_copy(update={"packages": packages})

    def package_of(self, token: str) -> tuple[DeliveryId, PackageId] | None:
        """The package of a token; None if the token was not made here."""
        delivery_id, _, rest = token.partition(".")
        package_id = rest.partition(".")[0]
        genuine = self._token(DeliveryId(delivery_id), PackageId(package_id))
        # Compared in constant time.
        is_genuine = hmac.compare_digest(genuine.encode(), token.encode())
        return (DeliveryId(delivery_id), PackageId(package_id)) if is_genuine else None

    def _with_path(self, packages: Iterable[Package], delivery_id: DeliveryId) -> Iterable[Package]:
        for each in packages:
            asked = each.dropoff_verification
            if asked is None or asked.method != "PHOTO":
                yield each
                continue
            path = f"{UPLOAD_PATHS}{self._token(delivery_id, each.package_id)}"
            planned = asked.model_copy(update={"upload_path": path})
            yield each.model_copy(update={"dropoff_verification": planned})

    def _token(self, delivery_id: DeliveryId, package_id: PackageId) -> str:
        # The ids have no dots and no spaces.
        about = f"skyway photo {delivery_id} {package_id}".encode()
        mac = hmac.digest(self._key, about, "sha256")[:_MAC_BYTES]
        return f"{delivery_id}.{package_id}.{urlsafe_b64encode(mac).decode()}"

    @cached_property
    def _key(self) -> bytes:
        return read_secret(self.secrets_dir, "tracking_key").encode()
