"""How much later than planned packages come, learned from packages that have come.

`skyway.delivery.lateness` is the pure decision. `lateness_forecast` keeps the last packages in
memory and makes moments of the lateness, and `store` is the SQL.
"""
