"""The pages of a run: which figures and findings they have, in which order, and what is said of them."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

from thesis_lib.foundation.errors import CorruptFileError
from thesis_lib.thesis.records.catalogue import openings, records
from thesis_lib.thesis.records.record import Figure
from thesis_lib.thesis.report.run import chapter_report, run_report

FOUND = "The error is 0.1 m/s & more."


@pytest.fixture
def results(tmp_path) -> Path:
    """A run with figure 3-8 of two datasets, 3-1, table 3.1 and one critique."""
    texts = ["claims.txt", "critique/proof/proof.txt", "critique/drops/verdict.txt"]
    texts += [f"chapter3/{name}" for name in ("drops/figure_3_8.txt", "drops/table_3_1.txt")]
    pictures = [f"chapter3/{name}/figure_3_8.png" for name in ("drops", "planar_dice")]
    for name in texts:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{FOUND}\n")
    for name in [*pictures, "chapter3/common/figure_3_1.png", "critique/drops/ladder.png"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        image.imsave(tmp_path / name, np.zeros((36, 72, 3)))
    (tmp_path / "chapter3/drops/table_3_1.csv").write_text("law\nmirtich\n")
    return tmp_path


def found_in(results: Path) -> list[Path]:
    return sorted(path for path in results.rglob("*.txt") if path.parent != results)


def opening(results: Path) -> str:
    return run_report(results, found_in(results), "quick")


def chapter(results: Path) -> str:
    return chapter_report(results, sorted(results.rglob("chapter3/**/*.txt")), "quick", chapter=3)


def test_it_opens_with_findings_and_one_picture_of_each_chapter(results):
    html = opening(results)
    assert re.findall(r"<h2[^>]*>([^<:]+)", html) == ["Chapter 3", "The critique"]
    assert html.count("<img") == 2  # of the chapter, and the ladder of the critique
    listed = re.findall(r'<li><a href="report_chapter3.html([^"]*)">([^<]+)</a>: ([^<]+)</li>', html)
    said = "The error is 0.1 m/s &amp; more."
    assert listed == [("#figure-3-8-drops", "Figure 3-8, drops", said), ("", "Table 3.1, drops", said)]
    assert "The whole chapter: 3 figures" in html and 'href="critique/drops/report.html"' in html


@pytest.mark.parametrize("number", openings())
def test_what_opens_a_chapter_is_of_it_and_finds_something(number):
    first, *rest = [records()[name] for name in openings()[number]]
    assert isinstance(first, Figure) and len(rest) == 4
    assert all(record.chapter == number and record.finding for record in (first, *rest))


def test_figures_are_grouped_by_dataset_and_what_was_not_made_is_left_out(results):
    html = chapter(results)
    assert re.findall(r'<figure id="([\w-]+)"', html) == ["figure-3-1", "figure-3-8-planar_dice", "figure-3-8-drops"]
    order = [
        html.index(text)
        for text in ("<h2>planar_dice: measured", 'figure-3-8-planar_dice"><div class="drawn"', "<h2>drops: sim")
    ]
    assert order == sorted(order)


def test_data_that_a_run_lacks_are_named_with_the_command_that_gets_them(results):
    assert "Data not present" not in opening(results)
    for html in (
        run_report(results, [], "quick", ["planar_dice"]),
        chapter_report(results, [], "quick", ["planar_dice"], chapter=3),
    ):
        assert "planar_dice (to get it: <code>thesis-lib datasets fetch planar-dice</code>)" in html


def test_what_was_found_stands_in_caption_and_alternative_text(results):
    html = chapter(results)
    drops = html[html.index('<figure id="figure-3-8-drops"') :]
    alt = re.search(r'alt="([^"]+)"', drops)[1]
    assert "0.1 m/s &amp; more" in alt and "<strong>Found in this run:</strong> The error" in drops
    dice = html[html.index('<figure id="figure-3-8-planar_dice"') : html.index('<figure id="figure-3-8-drops"')]
    assert "Found in this run" not in dice
    assert 'href="chapter3/drops/table_3_1.csv"' in html
    assert 'width="38" height="19"' in drops  # 72 x 36 pixels at 180 an inch, on a page of 96


def test_a_chapter_has_a_page_before_the_run_has_ended(results):
    for path in ("claims.txt", "critique/proof/proof.txt"):  # these come last
        (results / path).unlink()
    html = chapter(results)
    assert "Chapter 3: six impact laws" in html and 'href="report.html"' in html
    assert not re.findall("<figure", chapter_report(results, [], "quick", chapter=2))


def test_equal_runs_give_equal_pages(results):
    for written in (opening, chapter):
        assert written(results) == written(results)


def test_a_spoilt_picture_is_named(results):
    (results / "chapter3/drops/figure_3_8.png").write_bytes(b"GIF89a")
    with pytest.raises(CorruptFileError, match=r"drops/figure_3_8.png is not a picture; delete it"):
        chapter(results)
