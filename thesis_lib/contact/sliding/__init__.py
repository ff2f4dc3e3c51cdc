"""Compiled sliding path of an impact in space."""
