"""Table 2.1: all shapes in one table and one figure."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import read_tables, write_result
from thesis_lib.thesis.figures.chapter2.noise import figure_table_2_1

table = read_tables(snakemake.input, ["shape", "method", "snr", "mean_error", "error_over_bound", "thesis"])
write_result(table, snakemake.output.table)
save_figure(*figure_table_2_1(table), snakemake.output[0])
