"""What a customer asks (`request`), what a provider offers (`offer`), how it is flown (`plan`).

`lateness` learns from delivered packages how late others may come.
"""
