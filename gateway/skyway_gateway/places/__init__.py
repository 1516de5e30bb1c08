"""The places of a request as customers name them, and the stations that serve these places.

`customer_request` is the public form of a delivery request. Nothing of it that is personal leaves
the gateway: other services see `skyway.delivery.request.DeliveryRequest` alone.
"""
