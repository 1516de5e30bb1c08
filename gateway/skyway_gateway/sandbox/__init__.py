"""The sandbox: what answers test accounts in place of registry, composition and drones.

`network` is the network of the sandbox, `fleets` its providers and drones, and `outcomes` the
references and stations that force an outcome. `trips` plans, `script` says what a drone reports.
`sandbox_composition` books with these and `store`; `player` plays the reports.
Docs: docs/sandbox.md.
"""
