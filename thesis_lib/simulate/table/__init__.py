"""A puck that slides over a table between cushions, recorded from above"""
