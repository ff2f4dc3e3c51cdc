"""Records: what each figure and table of a run is and shows, said once.  `catalogue` finds them all."""
