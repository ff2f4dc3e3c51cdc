"""A critique's folder and its report.html.

Reading order:

| file                               | holds                                                                       |
|------------------------------------|-----------------------------------------------------------------------------|
| `folder`                           | writes a folder of results; what the pages of all critiques share           |
| `page`                             | the page of drops: its sections in order, sentences on data, laws, failures |
| `effects`                          | sentences on missing effects                                                |
| `tables`                           | tables, and the captions of the pictures                                    |
| `impacts`                          | the map of single impacts in section 2                                      |
| `few_impacts`                      | the page of impacts that are too few for a verdict                          |
| `mechanisms`                       | the page of a mechanism                                                     |
"""
