"""Residual contact learners: what named physics leaves unexplained, learned with calibrated uncertainty (chapter 4)."""
