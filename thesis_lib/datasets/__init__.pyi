"""For type checkers: what this package gives out; __init__.py imports it on first use."""

from thesis_lib.datasets.impacts.detect import find_impacts as find_impacts
from thesis_lib.datasets.read import dataset_of as dataset_of
from thesis_lib.datasets.read import read_dataset as read_dataset
