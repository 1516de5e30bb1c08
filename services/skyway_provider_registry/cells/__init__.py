"""The table of cells: which server of composition serves which network.

`routes` are the calls of operators and of the other services. `change_cells` adds, closes, opens
and moves cells, after it has asked the servers. `store` has the SQL.
"""
