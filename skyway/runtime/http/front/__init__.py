"""What a caller may do before its request reaches the app: bytes, seconds and connections.

uvicorn has settings for the connections of a process and for silence between requests only. So its
protocol is extended here: `front_protocol` reads requests, `front_limits` has the limits, and
`connection_table` decides which connection goes when there are too many.
"""
