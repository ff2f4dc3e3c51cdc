"""Numbers on the pages are those of stored tables."""

import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.wording import formatted
from thesis_lib.studies.docs.templates import filled, keep_results

STORED = "config/figures/default/planar_impact/figure_measured_ratio.csv"
TEMPLATE = f"""\
{{% set ratio = table("{STORED}", "variant == 'mirrored_rotation'") %}}
Our m/I is {{{{ ratio("ratio", ",.0f") }}}} ± {{{{ ratio("-std", ".1f") }}}} 1/m² once mirrored,
of {{{{ table("{STORED}")("ratio", ".0f", take="count") }}}} readings.
{{% for row in ratio.rows.itertuples() %}}
| {{{{ row.variant }}}} | {{{{ -row.ratio | as(".1e") }}}} |
{{% endfor %}}
"""


def test_numbers_are_written_and_words_stay():
    assert filled(TEMPLATE, "page.md") == (
        "Our m/I is 2,661 ± −14.3 1/m² once mirrored,\nof 4 readings.\n| mirrored_rotation | −2.7e+03 |\n"
    )


@pytest.mark.parametrize(
    ("value", "as_", "text"),
    [(-1.26, ".1f", "−1.3"), (-0.04, ".1f", "0.0"), (2.0, "+.0f", "+2"), (-0.0, "+g", "+0"), (1234, ",", "1,234")],
)
def test_a_zero_has_no_minus_sign(value, as_, text):
    assert formatted(value, as_) == text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{{ ratio(", "{{ other(", "'other' is undefined"),
        ('"ratio", ",', '"weight", ",', "weight"),
        ("variant == '", "variant = '", "cannot assign"),
        (STORED, "../secrets.csv", "neither a file of the repository"),
        (", \"variant == 'mirrored_rotation'\"", "", "leaves 4 rows for 'ratio', not one"),
        ('",.0f"', '"x"', "format code"),
        ("{% endfor %}", "", "endfor"),
    ],
)
def test_what_is_wrong_is_said(old, new, said):
    assert old in TEMPLATE
    with pytest.raises(UserError, match=f"page.md: .*{said}"):
        filled(TEMPLATE.replace(old, new), "page.md")


def test_tables_of_a_run_are_kept(tmp_path):
    templates, results = tmp_path / "templates", tmp_path / "run"
    templates.mkdir()
    (templates / "page.md").write_text(TEMPLATE.replace(STORED, "results/chapter2/ratio.csv"), encoding="utf-8")
    copy = tmp_path / "results" / "chapter2" / "ratio.csv"
    with pytest.raises(UserError, match="does not exist; run the rule"):
        keep_results(results, tmp_path, templates)
    (results / "chapter2").mkdir(parents=True)
    (results / "chapter2" / "ratio.csv").write_text("ratio\n1\n", encoding="utf-8")
    assert keep_results(results, tmp_path, templates) == [copy]
    assert copy.read_text(encoding="utf-8") == "ratio\n1\n"
    assert keep_results(results, tmp_path, templates) == []
    (results / "chapter2" / "ratio.csv").unlink()  # as in a run without the dataset
    assert keep_results(results, tmp_path, templates) == []
    (results / "chapter2" / "ratio.csv").write_text("1" * 200_000, encoding="utf-8")
    with pytest.raises(UserError, match="at most 100,000"):
        keep_results(results, tmp_path, templates)
