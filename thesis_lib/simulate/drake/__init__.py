"""Drops and mechanisms in Drake, with its own contact."""
