"""Functions that turn arrays and tables into (Figure, table of the plotted numbers); they read and write no files."""
