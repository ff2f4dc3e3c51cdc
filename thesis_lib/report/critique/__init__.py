"""A critique's folder and its report.html.

To be read in this order:

| file                               | holds                                                                       |
|------------------------------------|-----------------------------------------------------------------------------|
| `folder`, `whole_folder`           | from data to a folder of results, which is whole or not there               |
| `skeleton`                         | what the pages of all critiques share                                       |
| `page`                             | the page of drops: its sections in order                                    |
| `text`, `effects`                  | their sentences: of data and laws, where it fails; of effects that are missing |
| `tables`                           | their tables, and the captions of the pictures                              |
| `impacts`                          | the map of single impacts in section 2                                      |
| `mechanisms`                       | the page of a mechanism                                                     |
"""
