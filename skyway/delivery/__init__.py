"""What a customer asks (`request`, `qos`), what a provider offers (`offer`), how it flies (`plan`).

`verification` says how a hand-over is proven. `lateness` learns from delivered
packages how late others may come.
"""
