"""Physics engines as impact models: MuJoCo, Drake and Bullet, with parameters given by their physical meaning."""
