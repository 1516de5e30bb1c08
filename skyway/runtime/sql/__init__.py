"""A service's own database: connections, transactions and bulk writes, on SQLite and PostgreSQL.

Start at `database`, whose write blocks use `transaction`. Below it: `storage` (connections of a
file or a server), `sqlite_writer`, `engines`, `connection`; `bulk_write` and `single_statement`
(what a block writes at its end). For statements: `in_list`, `text_size`, `claims`, `trouble`.
"""
