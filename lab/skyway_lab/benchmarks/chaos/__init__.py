"""Chaos: a whole Skyway under faults, judged by drones' journals and customers' notifications.

`trial` is what is asked, `schedule` and `fault_kinds` say which fault comes when, `faults` make
them. `system` starts all processes, with a `wire` between each two. `customers`, `webhooks`,
`streams` and `journals` collect the evidence, `judgement` finds the flaws in it, `recovery` how
fast each part was back. `run` is one run, `page` writes its figures into the reference.
"""
