"""The live picture: one document of the whole fleet as it is, and a stream of its changes.

`feed` reads registry, composition and the gateway's own deliveries every 0.3 s, as long as
anybody looks. `sources` say what is read, `documents` shapes it. `figures`
asks services for their queues, lags and rates, for operators. `picture` holds all items and finds
what has changed. `scope` decides who sees what, `view` is what all viewers
of one scope share. `routes` sends `viewer_frames`: server-sent events.
"""
