"""Statistics of how pads and drones were used, from the steps that have ended.

`use` are the answers and their sums, `store` the SQL that adds up, `routes` the REST side.
"""
