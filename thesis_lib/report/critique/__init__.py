"""A critique's folder and its report.html.

Reading order:

| file                               | contents                                                                    |
|------------------------------------|-----------------------------------------------------------------------------|
| `folder`                           | writes the folder of results; parts common to the pages of all critiques    |
| `page`                             | the page of drops: its sections in order, sentences on data, laws, failures |
| `effects`                          | sentences on missing effects                                                |
| `tables`                           | tables, and the captions of the pictures                                    |
| `impacts`                          | the map of single impacts in section 2                                      |
| `body`                             | in space: the body with its hits, which a reader can rotate                 |
| `replay`                           | tosses or drops, measured and predicted                                     |
| `few_impacts`                      | the page of datasets with too few impacts for a verdict                     |
| `mechanisms`                       | the page of a mechanism                                                     |
"""
