"""The claims ledger: what the thesis states, what this program finds, and whether that has changed.

| module          | concept                                                                                   |
|-----------------|-------------------------------------------------------------------------------------------|
| `reading`       | YAML and CSV read strictly: every mistake listed in one error, no guessing of types       |
| `checks`        | where ours is found, and when it counts as reproduced                                     |
| `format`        | the format of config/claims/: published statements with source and check, a file a chapter |
| `result`        | a claim's status (reproduced, deviates, data not present, error) and the table claims.csv |
| `evaluate`      | our cell selected from the results and compared                                           |
| `expected`      | the statuses committed per scale; a change in either direction fails the check            |
| `figure_check`  | figures' CSVs against small stored copies                                                 |
| `page`          | results/claims.html                                                                       |

`python -m thesis_lib claims --help` says how to check, update and print.  A run of the pipeline does not fail on
an honest deviation from the thesis; continuous integration fails when a status changes.
"""
