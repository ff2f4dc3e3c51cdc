"""Drops and tosses simulated in MuJoCo, with its own contact."""
