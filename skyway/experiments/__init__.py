"""The paper's evaluation made again, and what lies past it: `skyway experiment`.

`page` lists the experiments, one file each; a `laboratory` runs their trials in worker processes;
`contest` is one run of one contestant. Everything is seeded: only the times differ between runs.
"""
