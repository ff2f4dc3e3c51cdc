"""Figures of the thesis, with a folder for each chapter."""
