"""The page of a run, and a page for each chapter."""
