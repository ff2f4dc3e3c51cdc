"""Recordings of a mechanism (arm with disk, rimless wheel), schema 1: format, reading, checking and writing."""
