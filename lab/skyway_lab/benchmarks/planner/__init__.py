"""The planner measured: two tables of speed, the paper's contestants, and peers from PyPI.

`python -m skyway_lab planner` prints a short run, `--full` every cell; `--json FILE` keeps the
numbers and `--page FILE` writes them into a page of the docs.
"""
