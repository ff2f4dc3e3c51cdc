"""User-defined effects and laws: loaded from a file or an installed package, checked, and named with their origin."""
