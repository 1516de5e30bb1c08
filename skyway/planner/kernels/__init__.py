"""The compiled part of the exact search: plain functions over arrays, and the only use of numba.

`memory` explains the arrays; `search` is the loop. Every function receives all its data as
arguments and runs without the interpreter's lock, so that several threads can solve in parallel.
"""
