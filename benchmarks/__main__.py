"""`make benchmark`: every benchmark, one after another, or those named."""

import subprocess
import sys
from pathlib import Path

SCRIPTS = {path.stem: path for path in sorted(Path(__file__).parent.glob("[a-z]*.py"))}


def main(names: list[str]) -> int:
    """Run these benchmarks; 2 when one is not known."""
    unknown = [name for name in names if name not in SCRIPTS]
    if unknown:
        print(f"no benchmark is called {unknown[0]!r}; there are {', '.join(SCRIPTS)}")
        return 2
    for name in names or SCRIPTS:
        print(f"== {name}", flush=True)
        subprocess.run([sys.executable, SCRIPTS[name]], check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
