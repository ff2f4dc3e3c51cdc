"""The dataset format, schema 1: header, tables, impacts as arrays; reading, writing and checking them."""
