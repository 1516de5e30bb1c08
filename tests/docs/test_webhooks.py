"""docs/reference/webhooks.md: its receivers accept what the gateway signs, and nothing else."""

import json
import re
import shutil
import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from skyway_gateway.notifications.webhook import new_webhook_secret, signed_headers

from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType

PAGE = (Path(__file__).parents[2] / "docs/reference/webhooks.md").read_text()
BODY = '{"type": "package.delivered", "name": "Gänsefeder"}'.encode()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


def verified_by_python(secret: str, headers: dict[str, str], body: bytes) -> bool:
    names: dict[str, Any] = {}
    exec(block("python"), names)
    return bool(names["verify"](secret, headers, body))


def verified_by_node(secret: str, headers: dict[str, str], body: bytes) -> bool:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    arguments = f"{json.dumps(secret)}, {json.dumps(headers)}, {json.dumps(body.decode())}"
    done = subprocess.run(
        [node, "-e", f"{block('javascript')}\nconsole.log(verify({arguments}))"],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return done.stdout.strip() == "true"


@pytest.mark.parametrize("verified", [verified_by_python, verified_by_node])
def test_a_receiver_accepts_what_the_gateway_signs_and_nothing_else(verified: Any) -> None:
    secret, now = new_webhook_secret(), datetime.now(UTC)

    headers = signed_headers((secret,), webhook_id="evt_1", at=now, body=BODY)
    old = signed_headers((secret,), webhook_id="evt_1", at=now - timedelta(minutes=6), body=BODY)

    assert verified(secret, headers, BODY)
    assert not verified(secret, headers, BODY + b" ")
    assert not verified(new_webhook_secret(), headers, BODY)
    assert not verified(secret, old, BODY)


@pytest.mark.parametrize("verified", [verified_by_python, verified_by_node])
def test_a_receiver_accepts_both_secrets_after_a_rotation(verified: Any) -> None:
    new, old = new_webhook_secret(), new_webhook_secret()

    headers = signed_headers((new, old), webhook_id="evt_1", at=datetime.now(UTC), body=BODY)

    assert verified(new, headers, BODY)
    assert verified(old, headers, BODY)
    assert not verified(new_webhook_secret(), headers, BODY)


def test_the_event_on_the_page_is_one() -> None:
    DeliveryEvent.model_validate_json(block("json"), extra="forbid")


def test_the_page_names_every_type_of_event() -> None:
    assert not [kind for kind in DeliveryEventType if f"`{kind}`" not in PAGE]
