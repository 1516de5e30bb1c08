"""The tools that others use read our documents: Spectral and the AsyncAPI parser, on node.

`.ci/run` installs both into `.node_tools`.
"""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
TOOLS = ROOT / ".node_tools" / "node_modules"
OPENAPI = ("gateway", "provider-registry", "composition")

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        shutil.which("node") is None or not TOOLS.is_dir(),
        reason="node or .node_tools is missing: see .ci/run",
    ),
]


def test_spectral_finds_nothing_in_the_openapi_documents() -> None:
    done = subprocess.run(
        [
            TOOLS / ".bin" / "spectral",
            "lint",
            f"--ruleset={HERE / 'spectral.yaml'}",
            "--format=json",
            "--quiet",
            *(ROOT / "openapi" / f"{service}.json" for service in OPENAPI),
        ],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )

    found = [
        f"{each['source']} {each['code']} {'.'.join(map(str, each['path']))}: {each['message']}"
        for each in json.loads(done.stdout)
    ]

    assert not found


def test_the_asyncapi_parser_accepts_our_document() -> None:
    done = subprocess.run(
        ["node", HERE / "parse_asyncapi.js", TOOLS, ROOT / "openapi" / "asyncapi.yaml"],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr
