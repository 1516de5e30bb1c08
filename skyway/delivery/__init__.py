"""What a customer asks (`request`, `qos`), what a provider offers (`offer`), how it flies (`plan`).

`lateness` learns from delivered packages how late others may come.
"""
