"""What each figure and table of a run shows, in sentences with its numbers: `thesis_lib.findings.finding`."""
