"""Learned models of pushing a block: hierarchical model abstractions and the baselines."""
