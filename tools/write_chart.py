"""Write what deploy/helm/skyway repeats of the project: a chart can read only its own folder.

python tools/write_chart.py

The alert rules, the broker's start script and the configuration of what stands before the broker
are copies. The broker's configuration and the rights of services are those that `skyway secrets`
writes, with the paths of the chart's pods. The schema of the values gets the settings of each
service, and Chart.yaml the version of the package.
"""

import json
import re
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from skyway_composition.settings import CompositionSettings
from skyway_gateway.settings import GatewaySettings
from skyway_provider_registry.settings import RegistrySettings

from skyway.broker_setup.mosquitto import TlsFiles, mosquitto_conf
from skyway.contracts.broker_rules import BrokerRules
from skyway.runtime.settings import ServiceSettings

ROOT: Final = Path(__file__).resolve().parent.parent
CHART: Final = ROOT / "deploy/helm/skyway"

#: Where the registry and the broker share a volume.
BROKER_FOLDER: Final = Path("/var/lib/skyway/broker")

SERVICES: Final[Mapping[str, type[ServiceSettings]]] = {
    "gateway": GatewaySettings,
    "registry": RegistrySettings,
    "composition": CompositionSettings,
}

#: Settings that the chart sets by itself, or that mean nothing in a pod.
NOT_FOR_VALUES: Final = frozenset(
    {
        "broker_kind",
        "broker_password_file",
        "broker_pid_file",
        "cell_url",
        "cells",
        "clock_file",
        "composition_url",
        "console_map",
        "database_url",
        "drone_ca_dir",
        "gateway_url",
        "host",
        "mqtt_url",
        "parent_fd",
        "port",
        "registry_url",
        "secrets_dir",
        "small_world_file",
        "socket_fd",
    }
)

#: What the schema of a setting keeps of the class's own.
_KEPT: Final = ("type", "minimum", "maximum", "exclusiveMinimum", "description")

#: JSON schemas have members of every type.
Schema = dict[str, Any]


def files() -> Mapping[Path, str]:
    """The text of each written file."""
    return {
        CHART / "files/alerts.yml": (ROOT / "deploy/prometheus/alerts.yml").read_text(),
        CHART / "files/broker/start.sh": (ROOT / "deploy/mosquitto/start.sh").read_text(),
        CHART / "files/broker/haproxy.cfg": (ROOT / "deploy/haproxy/broker.cfg").read_text(),
        CHART / "files/broker/mosquitto.conf": broker_configuration(),
        CHART / "files/broker/service_acl": BrokerRules().service_acl(),
        CHART / "values.schema.json": schema_of_values(),
        CHART / "Chart.yaml": chart(),
    }


def broker_configuration() -> str:
    """Mosquitto's configuration, as `skyway secrets --tls-name` writes it."""
    folder = BROKER_FOLDER
    return mosquitto_conf(
        port=1883,
        service_port=1884,
        password_file=folder / "passwords",
        pid_file=folder / "mosquitto.pid",
        user="mosquitto",
        host="0.0.0.0",
        tls=TlsFiles(8883, folder / "ca.pem", folder / "server.pem", folder / "server-key.pem"),
    )


def schema_of_values() -> str:
    """The schema that is there, with the settings of each service."""
    path = CHART / "values.schema.json"
    schema: Schema = json.loads(path.read_text(encoding="utf-8"))
    for name, settings in SERVICES.items():
        schema["definitions"][f"{name}Settings"] = schema_of_settings(settings)
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def schema_of_settings(settings: type[ServiceSettings]) -> Schema:
    """The variables that may be set for a service, with their limits."""
    properties = settings.model_json_schema()["properties"]
    return {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            f"SKYWAY_{name.upper()}": schema_of_setting(field)
            for name, field in sorted(properties.items())
            if name not in NOT_FOR_VALUES
        },
    }


def schema_of_setting(field: Schema) -> Schema:
    """One variable; of a setting that may be empty, the other alternative.

    A list is a text with commas: so it stands in the variable.
    """
    alternatives = [each for each in field.get("anyOf", ()) if each.get("type") != "null"]
    whole = {**field, **(alternatives[0] if alternatives else {})}
    if whole.get("type") == "array":
        whole["type"] = "string"
    return {name: whole[name] for name in _KEPT if name in whole}


def chart() -> str:
    """Chart.yaml with the version of the package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    text = (CHART / "Chart.yaml").read_text(encoding="utf-8")
    text = re.sub(r"^version: .*$", f"version: {project['version']}", text, flags=re.MULTILINE)
    quoted = f'appVersion: "{project["version"]}"'
    return re.sub(r"^appVersion: .*$", quoted, text, flags=re.MULTILINE)


if __name__ == "__main__":
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")
        print(f"{path.relative_to(ROOT)} written")
    sys.exit(0)
