"""Chapter 3: (μ, ε) of impact laws from many impacts and from each, and the predictive range of the laws."""
