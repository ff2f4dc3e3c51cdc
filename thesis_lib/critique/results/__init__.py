"""Results of a critique as data: diagnosis, tables, saved model, and the numbers behind its plots."""
