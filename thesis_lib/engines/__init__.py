"""Physics engines as models of an impact: MuJoCo and Drake, with parameters by their physical meaning."""
