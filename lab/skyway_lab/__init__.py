"""Experiments and benchmarks: what researchers and developers measure Skyway with."""
