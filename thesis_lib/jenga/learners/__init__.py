"""Learners of the push: hierarchical model abstractions and the baselines."""
