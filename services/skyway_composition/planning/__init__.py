"""Planning: how a request could be flown. It needs much computation and changes nothing.

`world` is what plans are made in, `problem_for` builds the planner's problems, `solver_pool` runs
the planner. `find_trip` finds whole trips, and `availability` where drones begin.
`plan_offers` prices and ranks trips: `contest` and `lower_bounds`
choose the candidates to compose, `split` uses several drones, `refusals` collects reasons,
`offer` is the result. `routes` answers REST.
"""
