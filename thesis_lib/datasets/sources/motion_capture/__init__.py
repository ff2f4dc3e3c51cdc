"""Readers of motions in space, one for each format of motion capture systems and ROS."""
