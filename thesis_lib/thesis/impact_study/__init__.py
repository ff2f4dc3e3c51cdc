"""Chapter 3: (μ, ε) of impact laws, identified from all impacts and from each, and the laws' predictive range."""
