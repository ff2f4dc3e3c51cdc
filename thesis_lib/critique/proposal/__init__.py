"""If no named effect fits: a new term, found by sparse regression, tested like any effect, written as a file."""
