"""Skyway: the library under every service, and usable without them.

Physics (`drone`), the skyway network (`network`), what customers ask and get (`delivery`), the
planner (`planner`) and what crosses a wire (`contracts`). Everything below `runtime` does no I/O
and reads no clock.
"""
