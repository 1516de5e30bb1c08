"""Experiments: the paper's evaluation repeated, and more. The command is `skyway experiment`.

`page` lists the experiments, a file or a folder each. A `laboratory` runs their trials in worker
processes; `contest` is one run of one contestant; `report` holds what an experiment reports.
Everything is seeded: only the times differ between runs.
"""
