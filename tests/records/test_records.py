"""What every record must have, and that files, rules and stored copies follow from it."""

import math
import re
from pathlib import Path

import pandas as pd
import pytest
from jinja2.meta import find_undeclared_variables
from jinja2.nodes import Name

from thesis_lib.foundation.columns import explain
from thesis_lib.thesis.ledger.figure_check import COMMON, ROW
from thesis_lib.thesis.records.catalogue import figures, records
from thesis_lib.thesis.records.record import sentences

ROOT = Path(__file__).resolve().parents[2]
RULES = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "workflow/rules").glob("*.smk"))
LONGEST = 90  # characters of a title: one line of a list
COMPARED = [figure for figure in figures() if not figure.not_compared]


@pytest.mark.parametrize("record", records().values(), ids=lambda record: record.name)
class TestRecords:
    def test_title_and_caption_are_plain_text_for_every_dataset(self, record):
        assert 0 < len(record.title) <= LONGEST and not re.search(r"[*{}]|\.$", record.title)
        assert record.title[0] == record.title[0].upper() or record.title.startswith("m/I")
        for dataset in record.job.datasets or ("",):
            text = record.text(dataset)
            assert not re.search(r"\{%|\{\{|\*\*|``", text)
            assert text.startswith((record.title, record.label)) and len(text) > 20  # also the alternative text

    def test_its_rule_gives_it_out(self, record):
        assert f"rule {record.job.rule}:" in RULES
        drawn, shown = f'drawn_by("{record.job.rule}")', f'shown("{record.name}"'
        assert (drawn if record.suffix == ".png" else shown) in RULES

    def test_its_caption_includes_what_was_found(self, record):
        included = re.findall(
            r"^\.\. include:: results/(\S+)", record.report_caption().replace("{{ ", "{").replace(" }}", "}"), re.M
        )
        path = f"{record.job.folder}/{record.name}.txt".lstrip("/")
        assert [each.lstrip("/") for each in included] == ([path] if record.finding else [])
        assert bool(record.finding) == bool(record.reads)

    def test_its_finding_knows_the_names_that_it_uses(self, record):
        template = sentences().parse(record.finding)
        set_in_it = {name.name for name in template.find_all(Name) if name.ctx == "store"}
        assert find_undeclared_variables(template) - set_in_it <= {
            *sentences().globals,
            *record.known,
            *(Path(name).stem for name in record.reads),
        }

    def test_its_caption_quotes_no_finding_that_a_run_could_change(self, record):
        """Sizes belong into findings, which a run computes; a caption "about ten times" cannot be kept true."""
        part = "(quarter|half|third|tenth|twice|times)"
        size = rf"factor of|\babout an? {part}|\b{part}\b of|per cent of|\d ?% of"
        # the colour scale of figure 3-9 is a rule, not a finding
        allowed = ["5 % of"] if record.name == "figure_3_9" else []
        text = " ".join(f"{record.title}. {record.caption}".split())
        assert [match[0] for match in re.finditer(size, text)] == allowed


@pytest.mark.parametrize("figure", figures(), ids=lambda figure: figure.name)
class TestFigures:
    def test_it_is_compared_column_by_column_or_says_why_not(self, figure):
        columns = [*figure.text_columns, *figure.number_columns]
        assert len(set(columns)) == len(columns) and ROW not in columns
        assert bool(columns) != bool(figure.not_compared)
        for tolerance in figure.tolerances.values():
            assert len(tolerance.reason) > 5
            assert min(tolerance.abs, tolerance.rel) >= 0 and 0 < tolerance.abs + tolerance.rel < math.inf

    def test_its_columns_have_unit_and_meaning(self, figure):
        columns = [*figure.text_columns, *figure.number_columns]
        assert len(explain(figure.name, columns, figure.columns)) == len(columns)
        assert all(len(meaning) > 5 for _, meaning in figure.columns.values())


@pytest.mark.parametrize("scale", ["quick", "default"])
@pytest.mark.parametrize("figure", COMPARED, ids=lambda figure: figure.name)
def test_a_copy_of_each_is_stored(figure, scale):
    for dataset in figure.files:
        copy = pd.read_csv(ROOT / "config/figures" / scale / (dataset or COMMON) / f"{figure.name}.csv", nrows=1)
        assert list(copy.columns) == [ROW, *figure.text_columns, *figure.number_columns]


def test_no_two_records_share_a_file():
    files = [path for record in records().values() for path in record.files.values()]
    assert len(set(files)) == len(files)


def test_figures_are_in_the_order_of_the_thesis():
    names = [figure.short for figure in figures()]
    assert names.index("3-8") < names.index("3-10") < names.index("4-1") < names.index("5-5c") < names.index("5-6")
    assert names.index("2-15") < names.index("hidden") < names.index("3-1")
