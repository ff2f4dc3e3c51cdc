"""The claims ledger: what the thesis states, what this program finds, and whether that has changed.

`reading` and `checks` stand below `format` (config/claims/), `evaluate` turns its claims and the results into `result`s
(claims.csv, claims.html), `expected` compares them with the committed statuses, `figure_check` the figures.

Usage: `python -m thesis_lib claims --help`.  A run of the pipeline does not fail on an honest deviation from the
thesis; continuous integration fails when a status changes.
"""
