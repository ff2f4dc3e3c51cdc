"""The claims ledger: what the thesis states, what this program finds, and whether that has changed.

| module          | concept                                                                                   |
|-----------------|-------------------------------------------------------------------------------------------|
| `reading`       | strict reading of YAML and CSV: one error lists every mistake, types are not guessed      |
| `checks`        | where our value is found, and when it counts as reproduced                                |
| `format`        | the format of config/claims/: published statements with source and check, by chapter      |
| `result`        | a claim's status (reproduced, deviates, data not present, error) and the table claims.csv |
| `evaluate`      | select our value from the results and compare it                                          |
| `expected`      | the statuses committed per scale; a change in either direction fails the check            |
| `figure_check`  | figures' CSVs against small stored copies                                                 |
| `page`          | results/claims.html                                                                       |

Usage: `python -m thesis_lib claims --help`.  A run of the pipeline does not fail on an honest deviation from the
thesis; continuous integration fails when a status changes.
"""
