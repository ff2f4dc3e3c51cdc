"""Physics engines judged beside the laws, on the same drops."""
