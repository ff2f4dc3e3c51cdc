"""Drops in Drake, with its own contact."""
