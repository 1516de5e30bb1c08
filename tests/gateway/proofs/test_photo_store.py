"""The store of photos: a folder, or a bucket of a server that speaks S3."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from skyway_gateway.proofs.photo_store import PhotoStore

from skyway.ids import DeliveryId, PackageId
from skyway.runtime.errors import ServiceUnavailable

KEY = DeliveryId("dlv_1"), PackageId("p1")


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The URL of an empty bucket; its server runs in this process."""
    moto = pytest.importorskip("moto.server", reason="moto[server] is not installed")
    server = moto.ThreadedMotoServer(port=0, verbose=False)
    server.start()
    _, port = server.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": "id",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(name, value)
    assert httpx.put(f"http://127.0.0.1:{port}/photos").status_code == 200
    yield "s3://photos/of/hand-overs"
    server.stop()


@pytest.fixture(params=["folder", "bucket"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> PhotoStore:
    """An empty store of each kind."""
    url: Any = tmp_path.as_uri()
    if request.param == "bucket":
        url = request.getfixturevalue("bucket")
    return PhotoStore(f"{url}/new")


async def test_the_last_photo_of_a_package_is_kept_until_it_is_deleted(store: PhotoStore) -> None:
    assert await store.get(*KEY) is None
    await store.put(*KEY, b"first")
    await store.put(*KEY, b"last")

    assert await store.get(*KEY) == b"last"
    assert await store.get(KEY[0], PackageId("p2")) is None
    for _ in range(2):
        await store.delete(*KEY)
    assert await store.get(*KEY) is None


async def test_a_store_that_cannot_be_written_is_unavailable(tmp_path: Path) -> None:
    (tmp_path / "new").write_text("no folder")
    store = PhotoStore(f"{tmp_path.as_uri()}/new")

    with pytest.raises(ServiceUnavailable):
        await store.put(*KEY, b"photo")
