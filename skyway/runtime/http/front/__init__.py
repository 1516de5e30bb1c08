"""Limits for callers before a request reaches the app: bytes, seconds and connections.

uvicorn only limits the connections of a process and the silence between requests. So its protocol
is extended here: `front_protocol` reads requests, `front_limits` has the limits, and
`connection_table` decides which connection is closed when there are too many.
"""
