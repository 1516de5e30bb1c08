"""The table of cells: which server of composition serves which network.

`routes` are the calls of operators and of the other services. `change_cells` asks the servers, and
then adds, closes, opens and moves cells. `store` has the SQL.
"""
