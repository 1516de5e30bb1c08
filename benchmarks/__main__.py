"""`make benchmark`: every benchmark, one after another, or the one named with its own options."""

import subprocess
import sys
from pathlib import Path

_HERE = Path(__file__).parent

#: A benchmark is a file, or a folder with a program of its own.
NAMES = sorted(
    [path.stem for path in _HERE.glob("[a-z]*.py")]
    + [path.parent.name for path in _HERE.glob("*/__main__.py")]
)


def main(arguments: list[str]) -> int:
    """Run one or all of them; 2 when it is not known."""
    if arguments and arguments[0] not in NAMES:
        print(f"no benchmark is called {arguments[0]!r}; there are {', '.join(NAMES)}")
        return 2
    for name in arguments[:1] or NAMES:
        print(f"== {name}", flush=True)
        command = [sys.executable, "-m", f"benchmarks.{name}", *arguments[1:]]
        subprocess.run(command, check=True, cwd=_HERE.parent)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
