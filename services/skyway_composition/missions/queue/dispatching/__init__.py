"""The dispatcher: it plans what waits in the calendars of a fleet again, all together.

`dispatch` finds a better order. `fleet` holds the drones and QUEUED missions that are searched
together: of one provider in one network, or of several that exchange deliveries, and says which
drone may fly which mission. `idle_drones` finds the drones without missions that could fly them.
`fleet_problem` describes the fleet for `skyway.dispatch`, which searches in `search_process`, a
process of its own. `merger` makes one mission of several that share a trip. `plan_orders` plans the
order that was found with the exact planner and judges whether it is better, and `adopt` saves it in
one transaction. `find_host` finds a waiting mission that carries a new request's packages too.
"""
