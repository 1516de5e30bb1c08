"""Each pod has the rights, settings and secrets that it needs, and no others."""

import re
from pathlib import Path

import pytest
import yaml
from pydantic_settings import BaseSettings
from skyway_composition.settings import CompositionSettings
from skyway_gateway.settings import GatewaySettings
from skyway_provider_registry.settings import RegistrySettings

from skyway.runtime.settings import DatabaseSettings
from tests.chart.chart_cases import CASES
from tests.chart.rendered import Documents, Outcomes, environment
from tools.pods_on_this_machine import IMAGE
from tools.write_settings import AGENT, COMMAND_LINE

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
DOCKERFILE = (ROOT / "Dockerfile").read_text()
SERVICES: dict[str, type[BaseSettings]] = {
    "gateway": GatewaySettings,
    "registry": RegistrySettings,
    "composition": CompositionSettings,
}


@pytest.fixture(params=list(CASES))
def found(request: pytest.FixtureRequest, outcomes: Outcomes) -> Documents:
    return outcomes[request.param]


def test_no_pod_has_rights_a_token_or_variables_of_other_services(found: Documents) -> None:
    uid = re.search(r"useradd --uid (\d+)", DOCKERFILE)
    assert uid is not None

    for pod in found.pods():
        security = pod.spec["securityContext"]
        assert security["runAsNonRoot"] is True
        assert security["runAsUser"] == int(uid[1])
        assert security["seccompProfile"] == {"type": "RuntimeDefault"}
        assert pod.spec["automountServiceAccountToken"] is False
        # A Service called skyway would set SKYWAY_PORT=tcp://... in every pod.
        assert pod.spec["enableServiceLinks"] is False
        assert not {"hostNetwork", "hostPID", "hostIPC"} & pod.spec.keys()


def test_every_server_of_a_cluster_is_named(outcomes: Outcomes) -> None:
    running = outcomes["clusters"].running()
    nodes = "mqtts+nats://node-a.example.org:8883,mqtts+nats://node-b.example.org:8883"

    registry, agents = (
        environment(running[each].spec["containers"][0]) for each in ("registry", "agents")
    )

    assert registry["SKYWAY_DATABASE_URL"].startswith(
        "postgresql://skyway_registry@db-1.example.org:5432,db-2.example.org:5432/skyway_registry?"
    )
    assert registry["SKYWAY_BROKER_KIND"] == "nats"
    assert registry["SKYWAY_MQTT_URL"] == agents["SKYWAY_MQTT_URL"] == nodes


def test_no_container_can_write_its_image_or_gain_rights(found: Documents) -> None:
    for pod in found.pods():
        for container in pod.containers:
            security = container["securityContext"]
            assert security["readOnlyRootFilesystem"] is True
            assert security["allowPrivilegeEscalation"] is False
            assert security["runAsNonRoot"] is True
            assert security["capabilities"] == {"drop": ["ALL"]}


def test_every_container_says_what_it_uses(found: Documents) -> None:
    for pod in found.pods():
        for container in pod.containers:
            assert container["resources"]["requests"].keys() >= {"cpu", "memory"}
            assert "memory" in container["resources"]["limits"]


def test_every_container_that_listens_is_probed(found: Documents) -> None:
    for pod in found.running().values():
        for container in pod.spec["containers"]:
            # Simulated drones listen to nothing; their process ends when it fails.
            if pod.component != "agents":
                probes = [
                    container[f"{kind}Probe"] for kind in ("startup", "readiness", "liveness")
                ]
                sources = [each.get("httpGet") or each["tcpSocket"] for each in probes]
                assert {each["port"] for each in sources} <= pod.ports.keys()
                paths = [each.get("path") for each in sources]
                assert paths in (["/healthz", "/readyz", "/healthz"], [None] * 3)


@pytest.mark.parametrize("name", SERVICES)
def test_every_variable_is_a_setting_of_its_service_with_a_right_value(
    found: Documents, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    container = found.running()[name].spec["containers"][0]
    fields = SERVICES[name].model_fields
    listed = [each["name"] for each in container["env"]]
    given = environment(container)

    assert len(listed) == len(given), "a variable is there twice"
    assert {each for each in given if each.startswith("SKYWAY_")} <= {
        f"SKYWAY_{field.upper()}" for field in fields
    }
    for variable, value in given.items():
        monkeypatch.setenv(variable, value)
    settings = SERVICES[name]()
    assert settings.model_dump()["port"] == found.running()[name].ports["http"]


def test_each_cell_is_a_composition_with_its_own_database_and_address(outcomes: Outcomes) -> None:
    found = outcomes["cells"]
    running = found.running()
    given = {name: environment(pod.spec["containers"][0]) for name, pod in running.items()}

    assert given["cell-texas"]["SKYWAY_DATABASE_URL"] == (
        "postgresql://skyway_composition@postgres:5432/skyway_cell_texas?connections=8"
    )
    assert given["cell-north"]["SKYWAY_DATABASE_URL"].startswith(
        "postgresql://skyway_composition@db-north.example.org:5432/skyway_cell_north?"
    )
    assert found.one("Deployment", "-cell-north")["spec"]["replicas"] == 3
    for name in ("composition", "cell-texas", "cell-north"):
        assert given[name]["SKYWAY_CELL_URL"] == f"http://skyway-{name}:8002"
        assert given[name]["SKYWAY_COMPOSITION_URL"] == "http://skyway-composition:8002"
    assert {each["SKYWAY_CELLS"] for each in given.values()} == {
        ",".join(
            f"{network}=http://skyway-cell-{cell}:8002"
            for network, cell in (
                ("texas-corridor", "texas"),
                ("north-1", "north"),
                ("north-2", "north"),
            )
        )
    }
    # Each has its own database, so each has a job that migrates the database.
    migrated = {
        environment(container)["SKYWAY_DATABASE_URL"]
        for job in found.of("Job")
        for container in job["spec"]["template"]["spec"]["containers"]
        if "migrate" in container["command"]
    }
    assert migrated >= {each["SKYWAY_DATABASE_URL"] for each in given.values()}
    assert len(migrated) == 5


def test_a_large_number_reaches_the_service_whole(outcomes: Outcomes) -> None:
    given = environment(outcomes["everything"].running()["gateway"].spec["containers"][0])

    assert given["SKYWAY_HTTP_CONNECTIONS"] == "1000000"
    assert given["SKYWAY_HOLD_S"] == "30.5"


def test_jobs_and_agents_have_only_settings_that_they_read(found: Documents) -> None:
    database = {f"SKYWAY_{field.upper()}" for field in DatabaseSettings.model_fields}
    agents = {row.variable for row in (*AGENT, *COMMAND_LINE)}
    for pod in found.pods():
        known = {"migrate": database, "agents": agents}.get(pod.component)
        if known is not None:
            names = {name for each in pod.containers for name in environment(each)}
            assert {name for name in names if name.startswith("SKYWAY_")} <= known


def test_every_service_finds_the_others(found: Documents) -> None:
    services = {
        each["metadata"]["name"]: [port["port"] for port in each["spec"]["ports"]]
        for each in found.of("Service")
    }
    for pod in found.pods():
        for container in pod.containers:
            for name, value in environment(container).items():
                url = re.match(r"(?:http|mqtt)://([a-z-]+):(\d+)$", value)
                if url is not None and name.endswith("_URL"):
                    assert int(url[2]) in services[url[1]], f"{pod.name}: {name}"


def test_each_pod_mounts_only_its_own_secrets(found: Documents) -> None:
    for pod in found.pods():
        mounted = {name: keys for name, keys in pod.secrets().items() if name != "database-ca"}
        service = pod.name.rpartition("-")[2]
        if "cell-" in pod.name:
            # A cell with a database server of its own has another password there.
            expected = "north-secrets" if service == "north" else "skyway-composition-secrets"
            is_job = pod.component == "migrate"
            assert mounted == {expected: ["pgpass"] if is_job else None}
        elif pod.component == "migrate":
            assert mounted == {f"skyway-{service}-secrets": ["pgpass"]}
        elif pod.component == "agents":
            assert mounted == {"skyway-commands": ["keys.env"]}
        else:
            others = {"skyway-drone-ca", "skyway-broker-tls"} if service == "registry" else set()
            assert mounted.keys() - others == {f"skyway-{service}-secrets"}


def test_every_mount_has_a_volume_and_secrets_are_read_only(found: Documents) -> None:
    for pod in found.pods():
        volumes = {each["name"]: each for each in pod.spec["volumes"]}
        for container in pod.containers:
            for mount in container.get("volumeMounts", ()):
                volume = volumes[mount["name"]]
                assert mount.get("readOnly", False) or "secret" not in volume, pod.name
        used = {m["name"] for each in pod.containers for m in each.get("volumeMounts", ())}
        assert used == volumes.keys(), f"{pod.name} has volumes that nothing mounts"


@pytest.mark.parametrize("name", SERVICES)
def test_paths_are_those_of_the_image_and_of_docker_compose(outcomes: Outcomes, name: str) -> None:
    compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
    theirs = compose["services"][name]["environment"]
    ours = environment(outcomes["default"].running()[name].spec["containers"][0])

    paths = {key for key, value in theirs.items() if str(value).startswith("/")} - {"PGPASSFILE"}

    assert {key: ours[key] for key in paths} == {key: theirs[key] for key in paths}
    # asyncpg ignores a passfile that the group can read, and a mounted Secret always is.
    assert ours["PGPASSFILE"] == "/var/run/passfile/pgpass"
    of_image = [f"{name}={value}" for name, value in IMAGE.items() if name.startswith("NUMBA_")]
    assert of_image
    assert all(each in DOCKERFILE for each in of_image)


def test_composition_can_write_where_the_planner_is_compiled(found: Documents) -> None:
    """Even the command that migrates loads the planner, and fails where it cannot write."""
    for pod in found.pods():
        for container in pod.spec["containers"]:
            if "skyway_composition" in container["command"]:
                cache = environment(container).get("NUMBA_CACHE_DIR", "/var/cache/skyway")
                mounts = {each["mountPath"]: each["name"] for each in container["volumeMounts"]}
                name = mounts.get(cache) or mounts[str(Path(cache).parent)]
                assert any(
                    each["name"] == name and "emptyDir" in each for each in pod.spec["volumes"]
                )


def test_commands_exist(found: Documents) -> None:
    for pod in found.pods():
        for container in pod.containers:
            command = container["command"]
            if command[:2] == ["python", "-m"]:
                assert next(ROOT.glob(f"*/{command[2]}/__main__.py"))
                assert command[3:] in ([], ["migrate"])
            else:
                assert command[0] in ("skyway", "sh", "install", "cp", "haproxy")


def test_migrations_run_before_anything_else_and_end_for_good_when_they_must(
    outcomes: Outcomes,
) -> None:
    found = outcomes["default"]
    policy = found.one("NetworkPolicy", "-migrate")["metadata"]["annotations"]

    assert {each["metadata"]["name"] for each in found.of("Job")} == {
        f"skyway-migrate-{name}" for name in SERVICES
    }
    for job in found.of("Job"):
        notes = job["metadata"]["annotations"]
        assert notes["helm.sh/hook"] == policy["helm.sh/hook"] == "pre-install,pre-upgrade"
        assert int(policy["helm.sh/hook-weight"]) < int(notes["helm.sh/hook-weight"])
        rules = job["spec"]["podFailurePolicy"]["rules"]
        # BAD_SETTINGS and BAD_DATABASE; NOT_NOW is tried again.
        assert rules[0]["onExitCodes"]["values"] == [2, 4]
        # Objects of the release, such as its account, are not there yet.
        assert "serviceAccountName" not in job["spec"]["template"]["spec"]


def test_there_is_never_a_second_writer_of_the_accounts(found: Documents) -> None:
    registry = found.one("Deployment", "-registry")["spec"]

    assert registry["replicas"] == 1
    assert registry["strategy"] == {"type": "Recreate"}
