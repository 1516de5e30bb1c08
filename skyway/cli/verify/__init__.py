"""`skyway verify`: each service checks its own database, and this compares what they say.

`command` is the command. `looks` runs the services, and compares their facts by the rules of
`delivery_rules` and `drone_rules`.
"""
