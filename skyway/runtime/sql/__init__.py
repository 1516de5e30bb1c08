"""What a service keeps: its database, the same to use on SQLite and PostgreSQL.

Read `database` first, then `transaction` and `declared`. Beneath them, SQLite has `sqlite_driver`,
`sqlite_writer` and `in_turn`; PostgreSQL has `lending`, `direct_connection` with `written`,
`prepared` and `found`, and `at_once` with `given`. For statements: `among`, `claims`, `taken`.
"""
