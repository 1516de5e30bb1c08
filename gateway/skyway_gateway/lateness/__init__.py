"""How much later than planned packages come, learned from packages that have come.

`calibrate` is a pure decision, `forecast` keeps the last packages in memory, `store` is the SQL.
"""
