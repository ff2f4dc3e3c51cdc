"""Questions to a finished critique of drops: where it fails, for which class of models, what to measure next."""
