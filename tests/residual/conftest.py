"""Tests of chapter 4, a folder a room; what several rooms share stands here beside them."""
