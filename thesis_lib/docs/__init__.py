"""Reference pages in docs/, written from the code: see `thesis_lib.docs.pages`."""
