"""Functions from arrays and tables to (Figure, table of the plotted numbers); they read and write no files."""
