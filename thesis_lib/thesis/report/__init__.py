"""Reports of a run: the opening page, and a page for each chapter."""
