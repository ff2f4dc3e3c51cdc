"""Every column of every result table has a unit and a meaning."""

import pandas as pd
import pytest
import yaml

from thesis_lib.foundation.columns import MEANINGS, explain, meanings
from thesis_lib.foundation.files import column_dictionary, write_result


def test_every_column_says_what_it_is():
    columns, tables = meanings()
    everything = [*columns.values(), *(m for own in tables.values() for m in own.values())]
    assert all(isinstance(unit, str) and len(meaning) > 5 for unit, meaning in everything)


def test_no_table_or_column_is_explained_twice():
    """YAML keeps the last of two equal keys without a word."""

    def keys(node):
        if not isinstance(node, yaml.MappingNode):
            return
        names = [key.value for key, _ in node.value if key.value != "<<"]
        assert len(names) == len(set(names)), sorted(n for n in names if names.count(n) > 1)
        for _, value in node.value:
            keys(value)

    keys(yaml.compose(MEANINGS.read_text(encoding="utf-8"), Loader=yaml.SafeLoader))


def test_a_table_may_give_a_column_its_own_meaning():
    assert explain("error_summary", ["median"]).loc[0, "unit"] == "m/s"
    assert explain("published_agreement", ["median"]).loc[0, "unit"] == "N s"
    assert explain("ensemble", ["cost"]).loc[0, "unit"] == "N s"


def test_the_viscous_law_has_a_coefficient_of_another_unit():
    for table in ("ensemble", "individual", "table_3_1", "published_parameters"):
        assert "s/m for mirtich" in explain(table, ["mu"]).loc[0, "meaning"], table


def test_an_unexplained_column_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(KeyError, match="wobble"):
        write_result(pd.DataFrame({"law": ["mirtich"], "wobble": [1.0]}), tmp_path / "table.csv")
    assert not list(tmp_path.iterdir())


def test_the_dictionary_lists_each_kind_of_table_once(tmp_path):
    for folder in ("a", "b"):
        write_result(pd.DataFrame({"law": ["mirtich"], "share": [0.2]}), tmp_path / folder / "coverage.csv")
    write_result(pd.DataFrame({"trial": [1], "train": [0]}), tmp_path / "a" / "split.csv")
    table = column_dictionary(tmp_path.rglob("*.csv"), {"split": {"trial": ("1", "drawn here")}})
    named = table["table"] + "." + table["column"]
    assert named.tolist() == ["coverage.law", "coverage.share", "split.trial", "split.train"]
    assert list(table["meaning"][table["column"] == "trial"]) == ["drawn here"]
