"""Drops in MuJoCo, with its own contact."""
