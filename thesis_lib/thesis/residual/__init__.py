"""Residual contact models: the part that named physics does not explain, learned with calibrated uncertainty."""
