"""Studies that prove the library: hidden causes looked for, tables of the proof, pages written from the code."""
