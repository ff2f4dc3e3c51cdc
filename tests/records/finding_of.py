"""What a record says of tables, for the tests of its words."""

from typing import Any

import pandas as pd

from thesis_lib.thesis.records.catalogue import records


def finding(record: str, *tables: Any) -> str:
    """The finding of a record, with plain spaces."""
    return records()[record].said(*tables).replace("\N{NO-BREAK SPACE}", " ")


def table(columns: str, *rows: tuple) -> pd.DataFrame:
    """A table of rows; its columns are separated by spaces."""
    return pd.DataFrame(rows, columns=columns.split())
