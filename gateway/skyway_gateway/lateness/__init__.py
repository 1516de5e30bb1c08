"""How much later than promised packages come, learned from those that have come.

`calibrate` is a pure decision, `forecast` keeps the last packages in memory, `store` is the SQL.
"""
