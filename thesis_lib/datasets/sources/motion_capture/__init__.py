"""Motions in space as motion capture systems and ROS write them: a reader for each format."""
