"""`skyway verify`: each service checks its own database, and this compares what they say.

`command` is the command, `looks` runs the services. `across` compares their facts by rules of
`delivery_rules` and `drone_rules`.
"""
