"""A puck that slides on a table between cushions, recorded from above."""
