"""The dataset format, schemas 1 (plane) and 2 (space): header, tables, impacts; reading, writing and checking them."""
