"""Snakemake's report of a run, as `make report` writes it, in headless Chromium."""

from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
REPORT = Path(__file__).parents[2] / "results" / "report.html"


@pytest.mark.skipif(not REPORT.is_file(), reason="there is no results/report.html: make report")
def test_the_report_of_the_pipeline_opens_without_network(visit):
    opened = visit(REPORT)
    opened.page.get_by_text("Contact models in robotic manipulation").first.wait_for(timeout=30_000)
    assert opened.complaints == []
    assert not [url for url in opened.requests if not url.startswith(("file:", "data:", "blob:"))]
