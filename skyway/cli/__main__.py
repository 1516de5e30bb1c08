"""`python -m skyway.cli`, the same as `skyway`."""

from skyway.cli.main import main

main()
