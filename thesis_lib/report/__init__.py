"""HTML pages: critiques of drops, of mechanisms and of a batch, and the page of a run."""
