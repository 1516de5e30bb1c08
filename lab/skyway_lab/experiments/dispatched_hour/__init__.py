"""A fleet's hour whose requests are planned together by the dispatcher, minute after minute.

`cases` draws fleet problems, `policies` plan them, and `rolling` flies an hour. `measures` runs a
trial, and `section` is the experiment.
"""
