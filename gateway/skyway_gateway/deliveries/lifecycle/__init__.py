"""The life of a delivery, as pure decisions: no database, no network, no clock is read.

`delivery` says what a delivery is and which states follow which. `progress` holds what all changes
have in common, and how a delivery ends. The `..._effects` say what a booking, a cancellation or a
mission report changes; `package_changes` is the part of reports that concerns packages.
`event_data` builds events. `delivery_parts` and `customer_forms` are what people see of a delivery.
"""
