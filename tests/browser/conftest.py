"""A headless browser without network, and one small example of every page."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from judged_tosses import BOX, judged_tosses

from thesis_lib.critique import criticise
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.foundation.files import write_text
from thesis_lib.report.batch_index import row_of_failure, row_of_verdict, write_index
from thesis_lib.report.critique.body import turnable
from thesis_lib.report.critique.folder import critique_page
from thesis_lib.report.critique.page import script
from thesis_lib.report.critique.replay import replay
from thesis_lib.simulate.compliant.example import simulate_example
from thesis_lib.thesis.ledger.evaluate import evaluate
from thesis_lib.thesis.ledger.format import Ledger
from thesis_lib.thesis.ledger.result import write_page
from thesis_lib.thesis.report.run import chapter_report, run_report

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
WIDE, NARROW = 1280, 400  # px: a desk, a telephone
CLAIM = {
    "chapter": 3,
    "location": "Table 3.1",
    "statement": "Friction of the first law.",
    "published": 0.26,
    "unit": "1",
    "source": {"file": "laws.csv", "where": {"law": "mirtich"}, "column": "mu"},
    "check": {"kind": "abs", "tolerance": 0.01, "reason": "printed with two digits"},
}


@dataclass
class Opened:
    """A page in the browser, with what it asked for and what it complained about."""

    page: object
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)


@pytest.fixture(scope="session")
def browser() -> Iterator:
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: make setup")
    path = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if path is None:
        pytest.skip("there is no chromium on this machine: apt-get install chromium")
    with api.sync_playwright() as playwright:
        # the sandbox needs rights that containers do not give; only our own pages are opened
        chromium = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def visit(browser) -> Iterator[Callable[..., Opened]]:
    """(path, width) -> the page, opened from its file with the network cut."""
    contexts = []

    def visit(path: Path, width: int = WIDE) -> Opened:
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True)
        contexts.append(context)
        opened = Opened(context.new_page())
        opened.page.on("request", lambda request: opened.requests.append(request.url))
        opened.page.on("pageerror", lambda error: opened.complaints.append(str(error)))
        opened.page.on("console", lambda said: opened.complaints.append(said.text) if said.type == "error" else None)
        opened.page.goto(path.resolve().as_uri(), wait_until="load")
        return opened

    yield visit
    for context in contexts:
        context.close()


def run_pages(folder: Path) -> tuple[str, str]:
    """The pages of a run that made one figure of two datasets, a table and the critique of `folder`; of the chapter."""
    findings = [folder / name for name in ("chapter3/drops/table_3_1.txt", "drops/verdict.txt")]
    for path in (*findings, folder / "claims.txt", folder / "critique/proof/proof.txt"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("The error is 0.1 m/s.\n")
    for name in ("drops", "planar_dice"):
        (folder / "chapter3" / name).mkdir(exist_ok=True)
        shutil.copy(folder / "drops/ladder.png", folder / "chapter3" / name / "figure_3_8.png")
    (folder / "chapter3/drops/table_3_1.csv").write_text("law\nmirtich\n")
    return run_report(folder, findings, "quick"), chapter_report(folder, findings, "quick", chapter=3)


@pytest.fixture(scope="session")
def in_space(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a page has of tosses in space alone."""
    tosses, path = judged_tosses(BOX), tmp_path_factory.mktemp("space") / "report.html"
    parts = {"Body": ("body", turnable(tosses)), "Tosses": ("replay", replay(tosses))}
    diagnosis = {"dataset": "tosses", "verdict": "adequate"}
    write_text(critique_page(diagnosis, parts, "effect", script=script()), path)
    return path


@pytest.fixture(scope="session")
def pages(browser, in_space: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Critique of few drops with a hidden cause, what is drawn in space, index of a batch, claims ledger."""
    folder = tmp_path_factory.mktemp("pages")
    drops = simulate_example("drops", "com_offset_x", drops=25).dataset
    settings = CritiqueSettings(folds=2, finalists=1)
    diagnosis = criticise(drops, effects=("com_offset",), settings=settings, seed=0).save(folder / "drops")
    rows = [row_of_verdict("drops", diagnosis), row_of_failure("bad", "The table is empty.")]
    write_index(rows, folder, total=2, seed=0, effects=None)
    (folder / "bad.log").touch()
    (folder / "laws.csv").write_text("law,mu\nmirtich,0.26\n")
    variants = {"holds": {}, "deviates": {"published": 0.1}, "absent": {"needs": ["dice"]}}
    claims = [{**CLAIM, "id": f"table_3_1.{name}", **more} for name, more in variants.items()]
    ledger = Ledger.model_validate({"schema": 1, "claims": claims})
    write_page(evaluate(ledger, folder, {"dice": False}), folder / "claims.html")
    for name, html in zip(("report.html", "report_chapter3.html"), run_pages(folder), strict=True):
        write_text(html, folder / name)
    return {
        "run": folder / "report.html",
        "chapter": folder / "report_chapter3.html",
        "critique": folder / "drops" / "report.html",
        "space": in_space,
        "index": folder / "index.html",
        "claims": folder / "claims.html",
    }
