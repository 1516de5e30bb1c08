"""Whether the plan of a mission still holds.

`situation` is a mission at one moment, `prediction` how its plan will go on, `check_plan` compares
both with the plan after each new state or event.
"""
