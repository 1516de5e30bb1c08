"""How deliveries are stored: each one as a row with its packages, custody and missions.

`write_delivery` is the only way to write one. `stored_delivery` says what was stored and caches the
latest; `delivery_rows` maps deliveries to rows; `delivery_store` holds the SQL.
"""
