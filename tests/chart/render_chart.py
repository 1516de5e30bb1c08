"""Renders, lints and checks the chart in a process of its own: Helm's SDK brings Go's runtime.

python render_chart.py TOOLS CHART <cases.json: reads ``{case: values}`` and writes what became of
each: its documents, the findings of the linter and of Kubernetes' schemas, or the error.
"""

import json
import sys
from collections.abc import Iterator
from functools import cache
from typing import Any, Final

#: The oldest version that Chart.yaml allows, and the newest one whose schemas are installed.
OLDEST: Final = "1.30.0"


def main() -> int:
    """Render every case of the standard input."""
    tools, chart = sys.argv[1:]
    sys.path.append(tools)
    cases = json.load(sys.stdin)
    json.dump({name: outcome(chart, values) for name, values in cases.items()}, sys.stdout)
    return 0


def outcome(path: str, values: dict[str, Any]) -> dict[str, Any]:
    """What became of one case. Any: values and documents are JSON of every kind."""
    import helm_python

    try:
        with helm_python.Chart.load(path) as chart:
            chart.validate_schema(values)
            texts = chart.render(values, name="skyway", namespace="drones")
    except helm_python.HelmError as error:
        return {"error": str(error)}
    found = list(documents(texts))
    return {
        "documents": found,
        "notes": texts["skyway/templates/NOTES.txt"],
        "lint": lint(path, values),
        "invalid": [fault for each in found for fault in faults(json.dumps(each))],
    }


def documents(texts: dict[str, str]) -> Iterator[dict[str, Any]]:
    """Every object of Kubernetes in the rendered templates."""
    import yaml

    for name, text in sorted(texts.items()):
        if name.endswith(".yaml"):
            yield from (each for each in yaml.safe_load_all(text) if each)


def lint(path: str, values: dict[str, Any]) -> list[str]:
    """What Helm's linter finds; severity 1 is information, such as a missing icon."""
    import helm_python

    report = helm_python.lint(path, values or None, strict=True, kube_version=f"v{OLDEST}")
    return [each["error"] for each in report["messages"] if each["severity"] > 1]


@cache
def faults(text: str) -> list[str]:
    """Where a document breaks Kubernetes' own schemas. They do not know Prometheus' objects."""
    import kubernetes_validate

    document, found = json.loads(text), []
    if document["apiVersion"].startswith("monitoring.coreos.com/"):
        return []
    for version in (OLDEST, kubernetes_validate.latest_version()):
        try:
            kubernetes_validate.validate(document, version, strict=True)
        except kubernetes_validate.ValidationError as error:
            name = f"{document['kind']} {document['metadata']['name']}"
            found.append(f"{version}: {name}: {error.message}")
    return found


if __name__ == "__main__":
    sys.exit(main())
