"""The console's page and files: complete, small, as npm has them, and open to no other host."""

import base64
import gzip
import hashlib
import json
import re
import tomllib
from importlib.resources import files
from pathlib import Path, PurePosixPath
from typing import Any, Final

import pytest
from skyway_gateway.access.scopes import SCOPES
from skyway_gateway.console.console_files import BaseMap, console_files, import_map_hash

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.network.bundled import texas_corridor
from skyway.network.geojson import write_network
from skyway.runtime.errors import NotFound
from tests.gateway.whole_gateway import Gateway

ROOT: Final = Path(__file__).parents[3]
FOLDER: Final = ROOT / "gateway/skyway_console/console"
PACKAGES: Final[list[dict[str, Any]]] = tomllib.loads(
    (ROOT / "tools/console_packages.toml").read_text()
)["package"]

#: Kilobytes that all scripts together may have when they are compressed.
MOST_SCRIPTS_KB: Final = 700

#: Data of the base map; all else is small.
GROUND: Final = {"map/ground.json", "map/ground-licences.txt"}

#: The base map that comes with Skyway, as the gateway sends it.
MOST_GROUND_BYTES: Final = 1_500_000

_IMPORTS: Final = re.compile(r'^import\s[^"]*"([^"]+)";', re.MULTILINE)


def own_scripts() -> list[str]:
    return [name for name in console_files() if name.endswith(".js")]


def import_map() -> dict[str, str]:
    page = console_files()["index.html"].content.decode()
    found = re.search(r'<script type="importmap">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    imports: dict[str, str] = json.loads(found[1])["imports"]
    return imports


async def test_the_page_needs_no_key_and_allows_no_other_host(gateway: Gateway) -> None:
    page = await gateway.http.get("/console")

    assert page.status_code == 200
    policy = page.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'self' 'sha256-")
    assert "unsafe" not in policy
    assert "http" not in policy
    assert page.headers["referrer-policy"] == "no-referrer"


def test_the_policy_allows_the_import_map_and_no_other_script_in_the_page() -> None:
    page = console_files()["index.html"].content.decode()
    scripts = re.findall(r"<script([^>]*)>(.*?)</script>", page, re.DOTALL)
    inside = [text for _, text in scripts if text]

    assert len(inside) == 1
    digest = base64.b64encode(hashlib.sha256(inside[0].encode()).digest()).decode()
    assert import_map_hash() == f"sha256-{digest}"


async def test_each_file_is_served_with_its_type(
    gateway: Gateway, subtests: pytest.Subtests
) -> None:
    types = {
        ".css": "text/css",
        ".js": "text/javascript",
        ".mjs": "text/javascript",
        ".json": "application/json",
        ".txt": "text/plain",
    }
    for name in sorted(set(console_files()) - {"index.html"}):
        with subtests.test(name):
            answer = await gateway.http.get(f"/console/{name}")

            assert answer.status_code == 200
            assert answer.content == (FOLDER / name).read_bytes()
            media_type = answer.headers["content-type"].split(";")[0]
            assert media_type == types[PurePosixPath(name).suffix]


async def test_a_file_that_a_browser_has_is_not_sent_again(gateway: Gateway) -> None:
    first = await gateway.http.get("/console/app.js")

    second = await gateway.http.get(
        "/console/app.js", headers={"If-None-Match": first.headers["etag"]}
    )

    assert (second.status_code, second.content) == (304, b"")


async def test_the_bundled_network_is_there_to_begin_with(gateway: Gateway) -> None:
    sent = await gateway.http.get("/console/bundled-network.json")

    assert sent.json() == write_network(texas_corridor())


async def test_a_browser_without_gzip_gets_the_file_unpacked(gateway: Gateway) -> None:
    plain = await gateway.http.get("/console/app.js", headers={"Accept-Encoding": "identity"})
    packed = await gateway.http.get("/console/app.js", headers={"Accept-Encoding": "gzip"})

    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert plain.content == packed.content


@pytest.mark.parametrize(
    "path",
    [
        "index.html",
        "../__init__.py",
        "%2e%2e/__init__.py",
        "vendor",
        "vendor/",
        "nothing.js",
        "/etc/passwd",
    ],
)
async def test_no_path_leads_out_of_the_folder(gateway: Gateway, path: str) -> None:
    assert (await gateway.http.get(f"/console/{path}")).status_code == 404


def test_copied_files_are_those_of_the_named_packages() -> None:
    """`tools/vendor_console.py` has recorded what npm has; nobody has changed a copy since."""
    recorded = json.loads((FOLDER / "vendor/checksums.json").read_text())
    found = {
        file.name: hashlib.sha256(file.read_bytes()).hexdigest()
        for file in (FOLDER / "vendor").iterdir()
        if file.name not in {"checksums.json", "LICENCES.txt"}
    }

    assert found == recorded
    assert set(found) == {name for package in PACKAGES for name in package["files"].values()}


def test_each_package_has_its_licence_version_and_checksum() -> None:
    licences = (FOLDER / "vendor/LICENCES.txt").read_text()

    for package in PACKAGES:
        assert f"{package['name']} {package['version']} ({package['license']})" in licences
        assert package["integrity"].startswith("sha512-")


def test_the_scripts_are_small_together() -> None:
    scripts = [name for name in console_files() if name.endswith((".js", ".mjs"))]
    kilobytes = sum(len(gzip.compress(console_files()[name].content)) for name in scripts) / 1_000

    assert kilobytes <= MOST_SCRIPTS_KB


def test_each_import_leads_to_a_file() -> None:
    names = import_map()
    for name in own_scripts():
        for target in _IMPORTS.findall(console_files()[name].content.decode()):
            if target.startswith("."):
                path = (FOLDER / name).parent / target
                assert path.resolve().is_file(), f"{name} imports {target}"
            else:
                assert names[target].removeprefix("/console/") in console_files()


def test_each_file_is_used() -> None:
    texts = "".join(
        console_files()[name].content.decode() for name in [*own_scripts(), "index.html"]
    )
    unused = [
        name
        for name in console_files()
        if name.endswith((".js", ".mjs", ".css")) and PurePosixPath(name).name not in texts
    ]

    assert unused == []
    assert set(console_files()) >= GROUND


def test_the_base_map_is_small_and_names_its_sources() -> None:
    ground = console_files()["map/ground.json"]
    sources = console_files()["map/base_map.js"].content.decode()

    assert len(ground.compressed) <= MOST_GROUND_BYTES
    for name in ("Natural Earth", "US Census", "GSHHG", "OpenStreetMap", "GeoNames"):
        assert name in sources
        assert name in console_files()["map/ground-licences.txt"].content.decode()


def test_no_script_writes_markup() -> None:
    """Texts that tenants choose reach the page as texts only."""
    for name in own_scripts():
        text = (files("skyway_console") / "console" / name).read_text()
        for way in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("):
            assert way not in text, f"{name} uses {way}"
        assert "dangerouslySet" not in text


def test_each_own_script_fits_on_few_screens() -> None:
    for name in own_scripts():
        lines = (FOLDER / name).read_text().splitlines()
        assert len(lines) <= 300, name
        assert lines[0].startswith("// "), f"{name} says first what it is for"


async def test_no_path_leads_out_of_an_operators_base_map(gateway: Gateway, tmp_path: Path) -> None:
    folder = tmp_path / "map"
    folder.mkdir()
    (folder / "style.json").write_text('{"version": 8}')
    (tmp_path / "secret").write_text("not of the map")
    (folder / "out").symlink_to(tmp_path / "secret")
    base_map = BaseMap(folder)

    assert base_map.file_at("style.json") == folder / "style.json"
    for path in ("../secret", "/etc/passwd", "out", "", ".", "nothing", "a\0b", "x" * 300):
        with pytest.raises(NotFound):
            base_map.file_at(path)
    assert (await gateway.http.get("/console-map/style.json")).status_code == 204


def test_forms_offer_all_scopes_and_all_events() -> None:
    """A new scope or type of event can be chosen in the console, too."""
    scopes = console_files()["parts/key_form.js"].content.decode()
    events = console_files()["parts/delivery_events.js"].content.decode()
    names = {event_type.split(".")[1] for event_type in DeliveryEventType}

    assert re.findall(r'"([a-z]+:[a-z]+)"', scopes) == list(SCOPES)
    assert names <= set(re.findall(r'"([a-z_]+)"', events))
