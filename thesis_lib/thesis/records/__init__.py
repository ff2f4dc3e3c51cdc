"""Records: the title, caption and finding of each figure and table of a run.  `catalogue` finds them all."""
