"""Where no named effect fits: a term for what is left, by sparse regression, tested like any effect, as a file."""
