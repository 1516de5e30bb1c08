"""How much later than planned packages come, learned from packages that have come.

`calibrate` is a pure decision, `lateness_forecast` keeps the last packages in memory, and `store`
is the SQL.
"""
