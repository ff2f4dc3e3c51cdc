"""The claims ledger: statements of the thesis, our values, and changes of their agreement.

`reading` and `checks` are used by `format` (config/claims/), `evaluate` turns claims and results into `result`s
(claims.csv, claims.html), `expected` compares them with the committed statuses, `figure_check` the figures.

Usage: `thesis-lib claims --help`.  A run of the pipeline does not fail on an honest deviation from the
thesis; continuous integration fails if a status changes.
"""
