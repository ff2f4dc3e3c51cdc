"""Drops and tosses simulated in Drake."""
