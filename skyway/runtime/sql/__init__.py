"""What a service keeps: its database, the same to use on SQLite and PostgreSQL."""
