"""Write docs/reference/settings.md: every SKYWAY_* setting, from the settings classes.

python tools/write_settings.py
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic.fields import FieldInfo
from skyway_composition.settings import CompositionSettings
from skyway_gateway.settings import GatewaySettings
from skyway_provider_registry.settings import RegistrySettings

from skyway.cells import CellSettings
from skyway.runtime.settings import ServiceSettings

PAGE: Final = Path(__file__).resolve().parent.parent / "docs/reference/settings.md"

HEAD: Final = """# Settings

Every process reads its settings from environment variables `SKYWAY_...`. `skyway up` sets all of
them; `docker-compose.yml` shows them for containers. A wrong or missing setting ends the process.
The error names the variable, never its value. Secrets are not settings: they are files of one line
in `SKYWAY_SECRETS_DIR`, as Docker and Kubernetes mount them.

`python tools/write_settings.py` writes this page from the settings classes, and
`python tools/write_chart.py` their limits into the [Helm chart](../kubernetes.md#values); tests
compare them.
"""


class Row(NamedTuple):
    """One setting as the page shows it."""

    variable: str
    range: str
    default: str
    about: str


#: Settings that are not in a settings class: the light processes, and the command line.
BROKER: Final = (
    Row(
        "SKYWAY_BROKER_PASSWORD_FILE", "path", "required", "The accounts that the registry writes."
    ),
    Row("SKYWAY_BROKER_HOST", "text", "`127.0.0.1`", "Address on which the broker listens."),
    Row("SKYWAY_BROKER_PORT", "whole number", "`0`", "Port on which it listens. 0: any free one."),
    Row(
        "SKYWAY_BROKER_CONNECTIONS",
        "whole number",
        "`16000`",
        "Open connections in all; fewer where the system allows fewer open files.",
    ),
    Row(
        "SKYWAY_BROKER_CONNECTIONS_PER_ADDRESS",
        "whole number",
        "`8000`",
        "Open connections of one address: a whole fleet may be behind one.",
    ),
    Row("SKYWAY_SOCKET_FD", "whole number", "", "A listening socket that the parent passes."),
    Row("SKYWAY_PARENT_FD", "whole number", "", "The broker ends when this pipe closes."),
    Row("SKYWAY_LOG_LEVEL", "text", "`INFO`", "DEBUG, INFO, WARNING or ERROR."),
)
AGENT: Final = (
    Row(
        "SKYWAY_MQTT_URL",
        "text",
        "or `--mqtt-url`",
        "The broker's listener for drones, instead of the addresses of the enrolment.",
    ),
    Row("SKYWAY_AGENT_JOURNAL", "path", "or `--journal`", "Folder of journals and credentials."),
    Row("SKYWAY_ENROLMENT_TOKEN", "text", "or `--enrol`", "A token to exchange once."),
    Row("SKYWAY_GATEWAY_URL", "text", "or `--api`", "Where the token is exchanged."),
    Row("SKYWAY_PARENT_FD", "whole number", "", "The agent ends when this pipe closes."),
    Row("SKYWAY_LOG_LEVEL", "text", "`INFO`", "DEBUG, INFO, WARNING or ERROR."),
    Row(
        "SKYWAY_AGENT_LOG",
        "path",
        "standard error; `skyway fleet`: `logs/fleet-....log` in the data folder",
        "The file of the log. Standard error then gets one line a minute.",
    ),
)
COMMAND_LINE: Final = (
    Row("SKYWAY_DATA", "path", "`.skyway`", "The data folder, where `--data` is not given."),
    Row(
        "NUMBA_CACHE_DIR",
        "path",
        "beside the planner's sources, else in the user's cache folder, else in the data folder",
        "Where compiled kernels are kept. Services that run alone and can write to neither of the "
        "first two need it.",
    ),
    Row(
        "NUMBA_CPU_NAME",
        "name of a processor",
        "this processor; in the image `x86-64-v3`",
        "For what kernels are compiled (decision 0046). NUMBA_CPU_FEATURES stays empty with it.",
    ),
    Row(
        "SKYWAY_DATABASE_URL",
        "text",
        "SQLite in the data folder",
        "`postgresql://...`: a server. `skyway up` makes one database for each service there.",
    ),
    Row(
        "SKYWAY_MQTT_URL",
        "text",
        "the embedded broker",
        "An own broker's listener for services. In `keys.env`: its listener for drones.",
    ),
    Row("SKYWAY_MQTT_DRONE_URL", "text", "", "The own broker's listener for drones and customers."),
    Row("SKYWAY_MQTT_TLS_URL", "text", "port 8883", "Its TLS listener (`skyway secrets`)."),
    Row("SKYWAY_GATEWAY_URL", "text", "from `keys.env`", "The gateway that commands ask."),
    Row(
        "SKYWAY_OPERATOR_KEY",
        "text",
        "from `keys.env`",
        "The key with which commands call, also those of providers and customers, where it is set.",
    ),
    Row(
        "SKYWAY_PROVIDER_KEY",
        "text",
        "-",
        "The key with which a provider's commands call, if no operator's key is set.",
    ),
    Row("SKYWAY_METRICS_KEY", "text", "from `keys.env`", "The key of `/metrics`."),
    Row(
        "SKYWAY_RAY_ADDRESS",
        "text",
        "local processes",
        "The Ray cluster for `skyway experiment` and `skyway dispatch --searches` (`skyway[ray]`).",
    ),
    Row("SKYWAY_CUSTOMER_KEY", "text", "from `keys.env`", "The key of `request` and `track`."),
    Row(
        "SKYWAY_MQTT_OPERATOR_PASSWORD", "text", "from `keys.env`", "The operator's broker account."
    ),
    Row("SKYWAY_OWN_MQTT_URL", "text", "from `keys.env`", "Names the embedded broker."),
    Row("SKYWAY_WEBHOOK_ALLOW_NETWORKS", "text", "`127.0.0.0/8`", "Passed to the gateway."),
    Row("SKYWAY_BROKER_FOLDER", "path", "", "In the Mosquitto container: where its files lie."),
)


def rows_of(settings: type[ServiceSettings], *, but: Sequence[str] = ()) -> Iterator[Row]:
    """A row for each field of a settings class."""
    for name, field in settings.model_fields.items():
        if name not in but:
            yield Row(f"SKYWAY_{name.upper()}", range_of(field), default_of(field), about(field))


def about(field: FieldInfo) -> str:
    """The description, without which no setting may be."""
    if not field.description:
        raise ValueError(f"{field} has no description")
    return field.description


def default_of(field: FieldInfo) -> str:
    """The default in code font, empty for none."""
    if field.is_required():
        return "required"
    return "" if field.default in (None, (), {}, frozenset()) else f"`{field.default}`"


def range_of(field: FieldInfo) -> str:
    """The type in plain words, with its limits."""
    kinds = set(get_args(field.annotation) or (field.annotation,))
    word = "text"
    for kind, name in ((Path, "path"), (int, "whole number"), (float, "number")):
        if kind in kinds:
            word = name
    limits = []
    for limit in field.metadata:
        match limit:
            case Gt(gt=value):
                limits.append(f"above {value}")
            case Ge(ge=value):
                limits.append(f"at least {value}")
            case Le(le=value) | Lt(lt=value):
                limits.append(f"at most {value}")
    return ", ".join([word, *limits])


def table(title: str, rows: Sequence[Row]) -> str:
    """A part of the page."""
    lines = [f"## {title}", "", "| setting | value | default | what |", "|---|---|---|---|"]
    lines += [f"| `{r.variable}` | {r.range} | {r.default} | {r.about} |" for r in rows]
    return "\n".join(lines) + "\n"


def page() -> str:
    """The text of the page."""
    shared = [name for name in CellSettings.model_fields if name != "port"]
    parts = [
        table("Every cloud service", list(rows_of(CellSettings, but=["port"]))),
        table("Gateway", list(rows_of(GatewaySettings, but=shared))),
        table("Provider registry", list(rows_of(RegistrySettings, but=shared))),
        table("Composition", list(rows_of(CompositionSettings, but=shared))),
        table("Embedded broker", BROKER),
        table("Drone agent", AGENT),
        table("Command line and containers", COMMAND_LINE),
    ]
    return "\n".join([HEAD, *parts])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"{PAGE.name} written")
    sys.exit(0)
