"""The compiled heart of the exact search: plain functions over arrays, and the only numba.

`memory` says what the arrays mean; `search` is the loop. Every function gets all it works on as
arguments and runs without the interpreter's lock, so that solves in several threads run at once.
"""
