"""The likelihood of measured impacts and flights under a model: observations, residuals, covariance, fit."""
