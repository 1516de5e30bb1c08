"""Messages that are stored with a transaction and sent until their receiver has them.

`Tx.send` and `Tx.report` write a row in the transaction of the change that the message reports.
`senders` send it afterwards, over MQTT or by HTTP: at least once, in the order of its stream.
`stream_sender` is the loop that both share, `outbox_store` the table and its SQL.
"""
