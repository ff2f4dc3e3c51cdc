"""The page that the last run of the pipeline wrote, in headless Chromium."""

from pathlib import Path

import pytest
from accessibility import SCRIPT
from conftest import NARROW, WIDE

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (Path(__file__).parents[2] / "results/report.html").is_file(),
        reason="there is no results/report.html: make reproduce",
    ),
]
REPORT = Path(__file__).parents[2] / "results/report.html"


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_it_opens_without_network_and_fits(visit, width):
    opened = visit(REPORT, width)
    assert opened.complaints == [] and opened.requests == [REPORT.as_uri()]
    assert opened.page.evaluate("document.documentElement.scrollWidth") == width


def test_every_picture_is_there_and_told_in_words(visit):
    page = visit(REPORT).page
    assert page.evaluate(SCRIPT) == []
    pictures = page.evaluate("[...document.images].map((i) => [i.naturalWidth, i.alt.length])")
    assert len(pictures) > 20 and all(width > 0 and words > 20 for width, words in pictures)


def test_links_lead_to_files_of_the_run(visit):
    links = visit(REPORT).page.evaluate("[...document.links].map((a) => a.getAttribute('href'))")
    files = [link for link in links if not link.startswith("#")]
    assert len(files) > 40 and [file for file in files if not (REPORT.parent / file).is_file()] == []
