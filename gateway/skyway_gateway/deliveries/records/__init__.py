"""How deliveries are stored: each one as a row with its packages, custody and missions.

`write_delivery` is the only way to write one. `delivery_rows` maps deliveries to rows and caches
the latest; `delivery_store` holds the SQL.
"""
