"""The dispatcher: it plans what waits in the calendars of a fleet again, all together.

`dispatch` runs it, and `find_order` finds a better order. `fleet` is what one provider's drones and
QUEUED missions are in one network, read by `store`. `fleet_problem` describes them for
`skyway.dispatch`, which searches in `search_process`, a process of its own. `merger` makes one
mission of several that share a trip. `plan_orders` plans the order that was found with the exact
planner, `judgement` decides whether it is better, and `adopt` saves it in one transaction.
`find_host` finds a waiting mission that carries a new request's packages too, and `join_host` has
the request join it.
"""
