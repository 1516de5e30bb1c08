"""Messages that leave with a transaction, and are sent until somebody has them.

A row is written by `Tx.send` or `Tx.report` in the transaction of the fact it tells; `mqtt_sender`
and `report_sender` deliver it afterwards, at least once, in the order of its stream.
"""
