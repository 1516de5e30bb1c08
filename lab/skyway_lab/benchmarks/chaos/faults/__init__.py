"""Faults: each is a block in which something is broken, and at whose end it is whole again.

`processes` ends and freezes, `wires` cuts and slows, `databases` locks and fills, `limits` sets
limits of processes, `poison` publishes false messages. `acting` finds the block of a planned fault.
"""
