"""`python -m skyway.runtime.healthcheck`: exits 0 when this container's service is ready."""

import os
import sys
import urllib.error
import urllib.request


def main() -> int:
    """Ask /readyz on `SKYWAY_PORT` of this host."""
    url = f"http://127.0.0.1:{os.environ['SKYWAY_PORT']}/readyz"
    try:
        with urllib.request.urlopen(url, timeout=3):
            return 0
    except (urllib.error.URLError, OSError):
        return 1


if __name__ == "__main__":
    sys.exit(main())
