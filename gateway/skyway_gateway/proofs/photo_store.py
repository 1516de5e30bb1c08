"""Where the photos of hand-overs are kept: a folder, or a bucket of an S3-compatible store."""

from functools import cached_property
from typing import Final

import obstore
from obstore.exceptions import BaseError
from obstore.store import ObjectStore, from_url

from skyway.ids import DeliveryId, PackageId
from skyway.runtime.errors import ServiceUnavailable

#: How long the store may take to answer, wall time.
_TIMEOUT: Final = "10s"

#: What the library raises for a store that does not do what is asked.
_TROUBLE: Final = (BaseError, OSError)


class PhotoStore:
    """Keeps one photo for each package.

    Parameters
    ----------
    url
        ``file:///folder`` or ``s3://bucket/prefix``. Keys and address of a bucket are read from the
        usual variables, such as ``AWS_ACCESS_KEY_ID`` and ``AWS_ENDPOINT_URL``.
    """

    def __init__(self, url: str) -> None:
        self._url = url

    @cached_property
    def _store(self) -> ObjectStore:
        if self._url.startswith("file:"):
            return from_url(self._url, mkdir=True)
        return from_url(
            self._url,
            client_options={"timeout": _TIMEOUT, "allow_http": True},
            retry_config={"max_retries": 2},
        )

    async def put(self, delivery_id: DeliveryId, package_id: PackageId, photo: bytes) -> None:
        """Keep a photo in place of an earlier one; it is there whole, or not at all.

        Raises
        ------
        ServiceUnavailable
            The store does not answer, or refuses.
        """
        try:
            await obstore.put_async(self._store, _name(delivery_id, package_id), photo)
        except _TROUBLE as error:
            raise _unavailable(error) from error

    async def get(self, delivery_id: DeliveryId, package_id: PackageId) -> bytes | None:
        """The photo; None if there is none. Raises as `put` does."""
        try:
            found = await obstore.get_async(self._store, _name(delivery_id, package_id))
            return bytes(await found.bytes_async())
        except FileNotFoundError:
            return None
        except _TROUBLE as error:
            raise _unavailable(error) from error

    async def delete(self, delivery_id: DeliveryId, package_id: PackageId) -> None:
        """Delete a photo; one that is gone is deleted already. Raises as `put` does."""
        try:
            await obstore.delete_async(self._store, [_name(delivery_id, package_id)])
        except FileNotFoundError:
            return
        except _TROUBLE as error:
            raise _unavailable(error) from error


def _name(delivery_id: DeliveryId, package_id: PackageId) -> str:
    return f"{delivery_id}/{package_id}.jpg"


def _unavailable(error: Exception) -> ServiceUnavailable:
    return ServiceUnavailable("photo store", type(error).__name__)
