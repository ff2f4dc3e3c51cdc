"""Studies that test the library: searches for hidden causes, tables of the proof, pages generated from the code."""
