"""Copy what the console uses from npm into the console's folder, with checksums and licences.

    python tools/vendor_console.py

needs `npm`; nothing else in Skyway does. `tools/console_packages.toml` names the packages, their
versions and checksums. `checksums.json` beside the copies records the SHA-256 of each file.
"""

import base64
import hashlib
import json
import subprocess
import tarfile
import tempfile
import tomllib
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parent.parent
PACKAGES: Final = ROOT / "tools/console_packages.toml"
VENDOR: Final = ROOT / "gateway/skyway_console/console/vendor"
_LICENCE_NAMES: Final = ("LICENSE", "LICENSE.txt")


class WrongPackage(Exception):
    """A package is not the one that was looked at when its version was chosen."""


def vendor() -> None:
    """Replace the content of the folder by the named files of the named packages."""
    packages = tomllib.loads(PACKAGES.read_text())["package"]
    VENDOR.mkdir(parents=True, exist_ok=True)
    for old in VENDOR.iterdir():
        old.unlink()
    checksums: dict[str, str] = {}
    licences: list[str] = []
    for package in packages:
        with tempfile.TemporaryDirectory() as folder:
            archive = _fetched(package, Path(folder))
            with tarfile.open(archive) as content:
                content.extractall(folder, filter="data")
            copied = _copy(package, Path(folder) / "package")
            licences.append(_licence(package, Path(folder) / "package"))
        checksums |= copied
    (VENDOR / "checksums.json").write_text(json.dumps(checksums, indent=2, sort_keys=True) + "\n")
    (VENDOR / "LICENCES.txt").write_text("\n".join(licences))
    print(f"{len(checksums)} files of {len(packages)} packages in {VENDOR.relative_to(ROOT)}")


def _fetched(package: dict[str, Any], folder: Path) -> Path:
    name = f"{package['name']}@{package['version']}"
    command = ["npm", "pack", "--silent", name, "--pack-destination", str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    archive = next(folder.glob("*.tgz"))
    digest = hashlib.sha512(archive.read_bytes()).digest()
    found = "sha512-" + base64.b64encode(digest).decode()
    if found != package["integrity"]:
        raise WrongPackage(f"{name} has the checksum {found}, not {package['integrity']}")
    return archive


def _copy(package: dict[str, Any], source: Path) -> dict[str, str]:
    checksums = {}
    for inside, name in package["files"].items():
        content = (source / inside).read_bytes()
        (VENDOR / name).write_bytes(content)
        checksums[name] = hashlib.sha256(content).hexdigest()
    return checksums


def _licence(package: dict[str, Any], source: Path) -> str:
    """The text of a package's licence; its name and author where the package holds no text."""
    title = f"{package['name']} {package['version']} ({package['license']})"
    files = (source / name for name in _LICENCE_NAMES)
    text = next((file.read_text() for file in files if file.exists()), None)
    if text is None:
        author = json.loads((source / "package.json").read_text()).get("author", "see its page")
        text = f"Author: {author}\nLicence: {package['license']}\n"
    return f"{title}\n{'-' * len(title)}\n{text}\n"


if __name__ == "__main__":
    vendor()
