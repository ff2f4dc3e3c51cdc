"""Physics engines as models of an impact: MuJoCo, Drake and Bullet, with parameters by their physical meaning."""
