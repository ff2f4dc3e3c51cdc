"""Recount the best and worst columns of table 3.1 from the stored predictions, and compare our laws with them."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from pathlib import Path

from thesis_lib.datasets.read import read_dataset
from thesis_lib.files import read_table, write_table
from thesis_lib.identify.stored_predictions import agreement, best_worst

impacts = read_dataset(Path(snakemake.input.header).parent).stated_impacts()
stored = read_table(Path(snakemake.input.predictions).parent / "published_predictions.csv")
write_table(best_worst(stored), snakemake.output.best_worst)
write_table(agreement(impacts, stored), snakemake.output.agreement)
