"""Reference pages in docs/, generated from the code: see `thesis_lib.studies.docs.pages`."""
