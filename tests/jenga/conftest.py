"""Tests of chapter 5, a folder a room; what several rooms share stands here beside them."""
