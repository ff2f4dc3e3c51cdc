"""Commands of the thesis: claims, tables and figures."""
