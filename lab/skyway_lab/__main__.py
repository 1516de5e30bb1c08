"""`make benchmark`: every benchmark, one after another, or the one named with its own options.

`python -m skyway_lab --help` lists them.
"""

import ast
import signal
import subprocess
import sys
from pathlib import Path

_HERE = Path(__file__).parent / "benchmarks"

#: A benchmark is a file, or a folder with a program of its own.
NAMES = sorted(
    [path.stem for path in _HERE.glob("[a-z]*.py")]
    + [path.parent.name for path in _HERE.glob("*/__main__.py")]
)


def main(arguments: list[str]) -> int:
    """Run one or all of them, or list them; 2 when it is not known."""
    if arguments and arguments[0] in ("-h", "--help"):
        print(__doc__)
        for name in NAMES:
            print(f"  {name:20} {_what_it_measures(name)}")
        return 0
    if arguments and arguments[0] not in NAMES:
        print(f"no benchmark is called {arguments[0]!r}; there are {', '.join(NAMES)}")
        return 2
    for name in arguments[:1] or NAMES:
        print(f"== {name}", flush=True)
        command = [sys.executable, "-m", f"skyway_lab.benchmarks.{name}", *arguments[1:]]
        if (code := _run(command)) != 0:
            return code
    return 0


def _what_it_measures(name: str) -> str:
    """The first line of a benchmark's docstring."""
    folder = _HERE / name
    source = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    said = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or ""
    return said.partition("\n")[0].removeprefix(f"`python -m skyway_lab {name}`: ")


def _run(command: list[str]) -> int:
    """Run a benchmark; SIGTERM is passed on to it, so that it can end what it has started."""
    process = subprocess.Popen(command)
    signal.signal(signal.SIGTERM, lambda *_: process.terminate())
    while True:
        try:
            return process.wait()
        except KeyboardInterrupt:  # the benchmark has received Ctrl-C too
            continue


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
