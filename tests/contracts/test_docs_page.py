"""The page /docs of the gateway shows every operation in a browser."""

import html
import json
import re
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import uvicorn
from skyway_gateway.app import openapi_app

from tests.end_to_end.browser import CHROMIUM, needs_browser

ROOT = Path(__file__).resolve().parents[2]
#: Milliseconds of the page's own clock: enough to read and draw the document.
DRAWN_MS = 20_000

pytestmark = [
    pytest.mark.integration,
    needs_browser,
]


@pytest.fixture
def url() -> Iterator[str]:
    """The gateway's address; nothing behind its documents is open."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        server = uvicorn.Server(uvicorn.Config(openapi_app(), log_level="warning"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [taken]})
        thread.start()
        while not server.started:
            time.sleep(0.05)
        yield f"http://127.0.0.1:{taken.getsockname()[1]}"
        server.should_exit = True
        thread.join()


@pytest.mark.long
def test_a_browser_shows_every_operation_on_the_docs_page(url: str, tmp_path: Path) -> None:
    paths = json.loads((ROOT / "openapi" / "gateway.json").read_text("utf-8"))["paths"]

    done = subprocess.run(
        [
            str(CHROMIUM),
            *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"),
            *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
            f"--user-data-dir={tmp_path}",
            f"--virtual-time-budget={DRAWN_MS}",
            "--dump-dom",
            f"{url}/docs",
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )

    shown = {html.unescape(path) for path in re.findall(r'data-path="([^"]+)"', done.stdout)}
    assert set(paths) <= shown
