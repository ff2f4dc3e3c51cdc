"""A critique's folder and its report.html."""
