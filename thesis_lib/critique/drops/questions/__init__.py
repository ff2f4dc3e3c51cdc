"""Analyses of a finished critique of drops: where models fail, which classes of models fail, what to measure next."""
