"""Replanning: a mission whose plan no longer holds gets a new revision.

`check_plan` compares the `prediction` of a mission's `situation` with its plan, and notes when the
plan no longer holds. `replan` takes such missions from the queue (`store`), `find_plan` plans their
`remainder`, and `replan` sends the new plan or gives up. `foresee` finds the same
plans for dry runs, and says what the `outlook` of a mission is. `propose` makes a revision, sends
it to a flying drone and handles its answer. `give_way` asks a drone for another standby.
`go_sooner` ends waits that are no longer needed. `call_off` ends a mission once its drone has
cancelled it.
"""
