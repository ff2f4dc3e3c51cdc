"""Written pages: the critique of drops, of mechanisms, of a batch, and the page of a run."""
