"""The chart renders with its default values and with every option; wrong values are refused."""

import re
from pathlib import Path

import pytest
import yaml

from tests.chart.chart_cases import CASES, WRONG
from tests.chart.rendered import Outcomes, selects

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("case", CASES)
def test_it_renders_and_the_linter_finds_nothing(outcomes: Outcomes, case: str) -> None:
    assert outcomes.findings(case, "error") is None
    assert outcomes.findings(case, "lint") == []


@pytest.mark.parametrize("case", CASES)
def test_every_document_is_valid_for_kubernetes(outcomes: Outcomes, case: str) -> None:
    assert outcomes.findings(case, "invalid") == []


@pytest.mark.parametrize("words", WRONG)
def test_a_wrong_value_is_refused_and_named(outcomes: Outcomes, words: str) -> None:
    error = outcomes.findings(words, "error") or "nothing was refused"

    assert words in error.replace("'", "")


@pytest.mark.parametrize("case", CASES)
def test_no_object_is_there_twice_and_no_secret_is_made(outcomes: Outcomes, case: str) -> None:
    names = [(each["kind"], each["metadata"]["name"]) for each in outcomes[case].all]

    assert len(names) == len(set(names))
    assert not outcomes[case].of("Secret")


def test_the_image_is_the_version_of_the_package(outcomes: Outcomes) -> None:
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert version is not None

    images = {each["image"] for pod in outcomes["default"].pods() for each in pod.containers}

    assert images == {f"skyway:{version[1]}", "eclipse-mosquitto:2"}


def test_the_broker_is_the_one_of_docker_compose(outcomes: Outcomes) -> None:
    compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
    containers = outcomes["default"].running()["registry"].spec["containers"]

    broker = next(each for each in containers if each["name"] == "mosquitto")

    assert broker["image"] == compose["services"]["mosquitto"]["image"]


def test_what_stands_before_the_broker_is_the_one_of_docker_compose(outcomes: Outcomes) -> None:
    front = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]["broker-front"]
    containers = outcomes["everything"].running()["registry"].spec["containers"]
    service = outcomes["everything"].one("Service", "sky-drones")

    own = next(each for each in containers if each["name"] == "broker-front")

    assert own["image"] == front["image"]
    assert {each["name"] for each in own["env"]} == set(front["environment"])
    ports = [port["name"] for port in own["ports"]]
    assert [port["targetPort"] for port in service["spec"]["ports"]] == ports


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ("default", "http://skyway-gateway:8000"),
        ("everything", "https://skyway.example.org"),
        ("bare", "http://skyway-gateway:8000"),
    ],
)
def test_the_gateway_knows_its_public_address(outcomes: Outcomes, case: str, expected: str) -> None:
    container = outcomes[case].running()["gateway"].spec["containers"][0]

    [found] = [each["value"] for each in container["env"] if each["name"] == "SKYWAY_PUBLIC_URL"]

    assert found == expected


def test_the_notes_warn_of_a_database_whose_certificate_is_not_verified(
    outcomes: Outcomes,
) -> None:
    assert "WARNING: database.sslMode is prefer" in outcomes.findings("clusters", "notes")
    assert "WARNING" not in outcomes.findings("default", "notes")


def test_the_certificate_of_the_database_is_verified_by_default(outcomes: Outcomes) -> None:
    for pod in outcomes["default"].pods():
        for container in pod.containers:
            env = {each["name"]: each.get("value") for each in container.get("env", ())}
            if "SKYWAY_DATABASE_URL" in env:
                assert env["PGSSLMODE"] == "verify-full"
                assert env["PGSSLROOTCERT"] == "/var/run/database-ca/ca.crt"


@pytest.mark.parametrize("case", CASES)
def test_every_object_points_at_what_exists(outcomes: Outcomes, case: str) -> None:
    found = outcomes[case]
    running = found.running()
    for service in found.of("Service"):
        pods = [
            p for p in running.values() if p.labels.items() >= service["spec"]["selector"].items()
        ]
        assert len(pods) == 1, service["metadata"]["name"]
        assert {port["targetPort"] for port in service["spec"]["ports"]} <= pods[0].ports.keys()
    for budget in found.of("PodDisruptionBudget"):
        assert any(selects(budget["spec"]["selector"], p.labels) for p in running.values())
    deployments = {each["metadata"]["name"] for each in found.of("Deployment")}
    for scaler in found.of("HorizontalPodAutoscaler"):
        assert scaler["spec"]["scaleTargetRef"]["name"] in deployments
    services = {each["metadata"]["name"] for each in found.of("Service")}
    for ingress in found.of("Ingress"):
        paths = [path for rule in ingress["spec"]["rules"] for path in rule["http"]["paths"]]
        assert {path["backend"]["service"]["name"] for path in paths} <= services


def test_autoscaling_leaves_the_replicas_to_the_autoscaler(outcomes: Outcomes) -> None:
    found = outcomes["everything"]

    scaled = {
        each["spec"]["scaleTargetRef"]["name"] for each in found.of("HorizontalPodAutoscaler")
    }

    assert scaled == {"sky-gateway", "sky-composition"}
    for each in found.of("Deployment"):
        assert ("replicas" in each["spec"]) == (each["metadata"]["name"] not in scaled)


def test_autoscaling_asks_for_metrics_that_exist(outcomes: Outcomes) -> None:
    page = (ROOT / "docs/reference/metrics.md").read_text()
    scalers = outcomes["everything"].of("HorizontalPodAutoscaler")

    sources = [metric for each in scalers for metric in each["spec"]["metrics"]]
    names = {
        s[kind]["metric"]["name"] for s in sources for kind in ("pods", "external") if kind in s
    }

    assert names == {"skyway_queue_depth", "skyway_planning_depth"}
    for name in names:
        assert f"| `{name}`" in page


def test_prometheus_reads_each_service_with_its_key_and_gets_our_rules(outcomes: Outcomes) -> None:
    found = outcomes["everything"]
    services = {each["metadata"]["name"]: each for each in found.of("Service")}

    for monitor in found.of("ServiceMonitor"):
        service = services.pop(monitor["metadata"]["name"])
        assert selects(monitor["spec"]["selector"], service["metadata"]["labels"])
        # The rules ask for this job.
        assert service["metadata"]["labels"][monitor["spec"]["jobLabel"]] == "skyway"
        endpoint = monitor["spec"]["endpoints"][0]
        assert endpoint["port"] in {port["name"] for port in service["spec"]["ports"]}
        assert endpoint["authorization"]["credentials"]["key"] == "metrics_key"
    rules = yaml.safe_load((ROOT / "deploy/prometheus/alerts.yml").read_text())

    assert services.keys() == {"sky-broker", "sky-drones"}
    assert found.one("PrometheusRule", "sky")["spec"] == rules


def test_the_notes_say_where_the_gateway_is(outcomes: Outcomes) -> None:
    assert "https://skyway.example.org" in outcomes.findings("everything", "notes")
    assert "port-forward service/skyway-gateway 8000" in outcomes.findings("default", "notes")
