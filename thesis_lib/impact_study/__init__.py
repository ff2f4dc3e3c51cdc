"""Chapter 3: (μ, ε) of impact laws from many impacts and from each, and what the laws can predict at all."""
