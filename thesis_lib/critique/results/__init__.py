"""What a critique leaves behind as data: diagnosis, tables, saved model, and the numbers behind its pictures."""
