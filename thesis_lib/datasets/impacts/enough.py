"""How many impacts a verdict needs, so that some trials choose the model and others judge it."""

MIN_TRIALS = 10
MIN_IMPACTS = 30


def are_enough(impacts: int, trials: int) -> bool:
    """Whether so many usable impacts in so many trials are enough for a verdict."""
    return impacts >= MIN_IMPACTS and trials >= MIN_TRIALS
