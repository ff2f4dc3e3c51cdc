"""Commands of the thesis: its claims, tables and figures."""
