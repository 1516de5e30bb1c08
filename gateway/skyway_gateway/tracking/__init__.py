"""Tracking pages: with the link of a delivery, people see without a key how it comes.

`link_store` keeps the links that were renewed or withdrawn; the others are made by
`tracking_links`. `pages` recognises links, `tracked` is what a page shows. `routes` are for
customers, and serve the page, its state and its stream.
"""
