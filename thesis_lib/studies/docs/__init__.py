"""Reference pages in docs/, written from the code: see `thesis_lib.studies.docs.pages`."""
