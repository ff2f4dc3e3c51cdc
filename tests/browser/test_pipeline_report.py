"""The pages that the last run of the pipeline wrote, in headless Chromium."""

from pathlib import Path

import pytest
from accessibility import SCRIPT
from conftest import NARROW, WIDE

RESULTS = Path(__file__).parents[2] / "results"
PAGES = ["report.html", "claims.html", *(f"report_chapter{n}.html" for n in (2, 3, 4, 5))]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (RESULTS / PAGES[0]).is_file(), reason="there is no results/report.html: make reproduce"),
]


@pytest.mark.parametrize("width", [WIDE, NARROW])
@pytest.mark.parametrize("name", PAGES)
def test_it_opens_without_network_and_fits(visit, name, width):
    opened = visit(RESULTS / name, width)
    assert opened.complaints == [] and opened.requests == [(RESULTS / name).as_uri()]
    assert opened.page.evaluate("document.documentElement.scrollWidth") == width


@pytest.mark.parametrize("name", PAGES)
def test_every_picture_is_there_and_told_in_words(visit, name):
    page = visit(RESULTS / name).page
    assert page.evaluate(SCRIPT) == []
    pictures = page.evaluate("[...document.images].map((i) => [i.naturalWidth, i.alt.length])")
    assert all(width > 0 and words > 20 for width, words in pictures)
    assert len(pictures) >= 5 or name == "claims.html"


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_to_places_in_files_of_the_run(visit, name):
    links = [
        link.partition("#")
        for link in visit(RESULTS / name).page.evaluate("[...document.links].map((a) => a.getAttribute('href'))")
    ]
    assert len(links) > 10 and [file for file, _, _ in links if not (RESULTS / (file or name)).is_file()] == []
    for file, _, anchor in links:
        if file.endswith(".html") and anchor:
            assert f'id="{anchor}"' in (RESULTS / file).read_text(encoding="utf-8")
