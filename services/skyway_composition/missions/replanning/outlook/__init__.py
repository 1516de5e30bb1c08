"""Whether the plan of a mission still holds.

`situation` is a mission at one moment, `prediction` how its plan will go on, `deviation` compares
both with the plan, `check_plan` does so after each new state or event.
"""
