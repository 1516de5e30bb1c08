"""Write openapi/: one OpenAPI document per service, AsyncAPI, and each message's JSON Schema.

python tools/write_openapi.py            everything
python tools/write_openapi.py gateway    of the services only these
"""

import json
import sys
from collections.abc import Iterable, Iterator
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import yaml

from skyway.contracts.asyncapi import asyncapi_document, message_schemas
from skyway.contracts.topics import TOPICS

FOLDER: Final = Path(__file__).resolve().parent.parent / "openapi"

#: The package of each service whose `app` module offers `openapi_app()`.
SERVICES: Final = {
    "gateway": "skyway_gateway",
    "provider-registry": "skyway_provider_registry",
    "composition": "skyway_composition",
}


def service_files(services: Iterable[str]) -> Iterator[tuple[str, str]]:
    """The name and the text of each service's document."""
    for service in services:
        yield f"{service}.json", _json_text(openapi_document(service))


def message_files() -> Iterator[tuple[str, str]]:
    """The name and the text of all that comes from the topics."""
    yield "asyncapi.yaml", _yaml_text(asyncapi_document(TOPICS, version=version("skyway")))
    for name, schema in message_schemas(TOPICS).items():
        yield f"messages/{name}.json", _json_text(schema)


def openapi_document(service: str) -> dict[str, Any]:  # a JSON document
    """The OpenAPI document of a service's app, which is built but never opened."""
    document: dict[str, Any] = import_module(f"{SERVICES[service]}.app").openapi_app().openapi()
    return document


def _json_text(document: object) -> str:
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _yaml_text(document: object) -> str:
    return yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100)


def main(services: list[str]) -> int:
    """Write the files, and remove those of messages that are no more."""
    texts = dict(message_files()) | dict(service_files(services or SERVICES))
    for old in FOLDER.glob("messages/*.json"):
        if f"messages/{old.name}" not in texts:
            old.unlink()
    for name, text in texts.items():
        path = FOLDER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    print(f"{len(texts)} files written to openapi/")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
