"""Figures of the thesis, a folder for each chapter."""
