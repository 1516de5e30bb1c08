"""Write openapi/: one OpenAPI document per service, AsyncAPI, and each message's JSON Schema.

The gateway's document is the whole public API. Its forwarded operations are copied from the other
services' documents into the gateway's package, from where the running gateway shows them too.
"""

import json
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import yaml
from skyway_gateway.forward.document import RESOURCE, forwarded_document, whole_document
from skyway_gateway.notifications.routes import with_event_examples

from skyway.contracts.asyncapi import asyncapi_document, message_schemas
from skyway.contracts.topics import TOPICS
from skyway.runtime.http.app import ServiceApp

ROOT: Final = Path(__file__).resolve().parent.parent

#: The package of each service whose `app` module offers `openapi_app()`.
SERVICES: Final = {
    "gateway": "skyway_gateway",
    "provider-registry": "skyway_provider_registry",
    "composition": "skyway_composition",
}


def service_files() -> Iterator[tuple[str, str]]:
    """The path and the text of each service's document, and of the gateway's resource."""
    registry = openapi_document("provider-registry")
    composition = openapi_document("composition")
    forwarded = forwarded_document({"registry": registry, "composition": composition})
    yield "openapi/provider-registry.json", _json_text(registry)
    yield "openapi/composition.json", _json_text(composition)
    yield f"gateway/skyway_gateway/forward/{RESOURCE}", _json_text(forwarded)
    gateway = app_of("gateway")
    gateway.publish = lambda own: whole_document(with_event_examples(own), forwarded)
    yield "openapi/gateway.json", _json_text(gateway.openapi())


def message_files() -> Iterator[tuple[str, str]]:
    """The name and the text of all that comes from the topics."""
    yield "openapi/asyncapi.yaml", _yaml_text(asyncapi_document(TOPICS, version=version("skyway")))
    for name, schema in message_schemas(TOPICS).items():
        yield f"openapi/messages/{name}.json", _json_text(schema)


def openapi_document(service: str) -> dict[str, Any]:  # a JSON document
    """The OpenAPI document of a service's app, which is built but never opened."""
    return app_of(service).openapi()


def app_of(service: str) -> ServiceApp:
    """The app of a service that only documents itself."""
    app: ServiceApp = import_module(f"{SERVICES[service]}.app").openapi_app()
    return app


def _json_text(document: object) -> str:
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _yaml_text(document: object) -> str:
    return yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100)


def main() -> int:
    """Write the files, and remove those of messages that are no more."""
    texts = dict(message_files()) | dict(service_files())
    for old in (ROOT / "openapi").glob("messages/*.json"):
        if f"openapi/messages/{old.name}" not in texts:
            old.unlink()
    for name, text in texts.items():
        path = ROOT / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    print(f"{len(texts)} files written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
