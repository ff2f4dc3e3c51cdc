"""Figures: functions that take arrays and tables and return (Figure, table of the plotted numbers); no file access."""
