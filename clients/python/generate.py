"""Generates the parts of `skyway_client` that follow from the OpenAPI document.

`openapi-python-client` makes the models and, by our templates, one function for each operation.
This module makes `problems.py`, an exception for each problem type and code, and
`delivery_events.py`, which has the class of each event type. Hatchling calls it for each build.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# What a JSON document holds.
Json = Any

_TEMPLATES = Path(__file__).parent / "templates"
_METHODS = ("get", "put", "post", "patch", "delete")


class GeneratedCode(BuildHookInterface):  # type: ignore[type-arg]
    """What hatchling calls before it collects the files of the package."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Generate from the document of the checkout, or of the source distribution."""
        root = Path(self.root)
        packed = root / "gateway.json"
        document = packed if packed.exists() else root.parents[1] / "openapi" / "gateway.json"
        generate(document, package=root / "skyway_client")


def generate(document_path: Path, *, package: Path) -> None:
    """Write the generated files into the package, instead of those of an earlier run."""
    document = json.loads(document_path.read_text())
    (package / "problems.py").write_text(problems_module(document))
    (package / "delivery_events.py").write_text(events_module(document))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "answers.json").write_text(json.dumps(only_answers(document)))
        (folder / "config.json").write_text('{"post_hooks": []}')
        _run_generator(folder)
        for part in ("api", "models"):
            shutil.rmtree(package / part, ignore_errors=True)
            shutil.move(folder / "made" / part, package / part)
        shutil.move(folder / "made" / "types.py", package / "types.py")


def _run_generator(folder: Path) -> None:
    command = (
        *(sys.executable, "-m", "openapi_python_client", "generate", "--fail-on-warning"),
        *("--meta", "none", f"--custom-template-path={_TEMPLATES}"),
        *(f"--path={folder / 'answers.json'}", f"--config={folder / 'config.json'}"),
        f"--output-path={folder / 'made'}",
    )
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"openapi-python-client failed:\n{done.stdout}{done.stderr}")


def only_answers(document: Json) -> Json:
    """The document without what `skyway_client` does not generate.

    Problems are raised. Streams have `Skyway.events`. Drones alone upload pictures. Of an answer's
    forms JSON is kept. A picture is bytes.
    """
    kept = json.loads(json.dumps(document))
    kept.pop("webhooks", None)
    for operations in kept["paths"].values():
        for method in [each for each in operations if each in _METHODS]:
            answers = {
                status: answer
                for status, answer in operations[method]["responses"].items()
                if status.startswith("2")
            }
            is_upload = "image/jpeg" in operations[method].get("requestBody", {}).get("content", {})
            forms = [form for each in answers.values() for form in each.get("content", {})]
            if is_upload or "text/event-stream" in forms:
                del operations[method]
            else:
                operations[method]["responses"] = answers
            for answer in answers.values():
                if json_form := answer.get("content", {}).get("application/json"):
                    answer["content"] = {"application/json": json_form}
                elif picture := answer.get("content", {}).get("image/jpeg"):
                    answer["content"] = {"application/octet-stream": picture}
    return kept


def problems_module(document: Json) -> str:
    """A module with one exception for each problem type, and one for each code of a type."""
    codes: dict[str, set[str]] = {}
    for problem in _problems(document):
        codes.setdefault(problem["type"], set()).update(filter(None, [problem.get("code")]))
    lines = [
        '"""The problems that the API documents: one exception for each type and each code."""',
        "",
        "from skyway_client.errors import SkywayError",
    ]
    types: dict[str, str] = {}
    by_code: dict[str, str] = {}
    for uri in sorted(codes):
        parent = types[uri] = _class_name(uri.rpartition(":")[2].split("-"))
        lines += _exception(parent, "SkywayError", f"`{uri}`.")
        for code in sorted(codes[uri]):
            by_code[code] = _class_name(code.lower().split("_"))
            lines += _exception(by_code[code], parent, f"`{uri}` with the code {code}.")
    lines += ["", "", *_table("BY_TYPE", "type[SkywayError]", types)]
    lines += ["", *_table("BY_CODE", "type[SkywayError]", by_code)]
    return "\n".join(lines) + "\n"


def _problems(part: Json) -> Iterator[Json]:
    """All examples of problem documents."""
    if isinstance(part, list):
        for each in part:
            yield from _problems(each)
    if not isinstance(part, dict):
        return
    if str(part.get("type", "")).startswith("urn:skyway:problem:") and "status" in part:
        yield part
    for each in part.values():
        yield from _problems(each)


def _class_name(words: list[str]) -> str:
    return "".join(word.capitalize() for word in words)


def _exception(name: str, parent: str, doc: str) -> list[str]:
    return ["", "", f"class {name}({parent}):", f'    """{doc}"""']


def _table(name: str, kind: str, rows: dict[str, str]) -> list[str]:
    return [
        f"{name}: dict[str, {kind}] = {{",
        *(f'    "{key}": {value},' for key, value in rows.items()),
        "}",
    ]


def events_module(document: Json) -> str:
    """A module with the union of all events of a delivery, and the class of each event type."""
    body = document["webhooks"]["delivery-event"]["post"]["requestBody"]
    mapping = body["content"]["application/json"]["schema"]["discriminator"]["mapping"]
    classes = {kind: schema.rpartition("/")[2] for kind, schema in mapping.items()}
    names = sorted(set(classes.values()))
    lines = [
        '"""The events of a delivery, as webhooks and event streams carry them."""',
        "",
        "from skyway_client.models import (",
        *(f"    {name}," for name in names),
        ")",
        "",
        "DeliveryEvent = (",
        "    " + "\n    | ".join(names),
        ")",
        "",
        *_table("BY_TYPE", "type[DeliveryEvent]", classes),
    ]
    return "\n".join(lines) + "\n"
