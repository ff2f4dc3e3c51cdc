"""The pages in docs/ agree with the code, with each other, and with the pictures beside them."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tutorial_runner import ROOT

from thesis_lib.contact import LAWS
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.foundation.columns import meanings
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import PLANE
from thesis_lib.studies.docs.__main__ import main
from thesis_lib.studies.docs.pages import BLOCKS, rendered, stale_pages

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
LARGEST = 70_000  # bytes of a picture
LINK = re.compile(r"(?<!\!)\[[^\]]*\]\(([^)\s]+)\)")
PICTURE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")
EACH_PAGE = pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)


def test_pages_are_in_step_with_the_code():
    assert not stale_pages(DOCS), "python -m thesis_lib.studies.docs writes them anew, from docs/templates/ if there"


def test_every_block_is_on_a_page():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for name in BLOCKS:
        assert text.count(f"<!-- written by python -m thesis_lib.studies.docs: {name} -->") == 1


def test_a_page_out_of_step_is_named_and_mended(tmp_path, capsys):
    page = tmp_path / "page.md"
    good = rendered(_block("dataset keys", ""), "page")
    page.write_text(f"before\n{good}\nafter\n".replace("radius_of_gyration", "radius"), encoding="utf-8")
    assert main(["--check", "--docs", str(tmp_path)]) == 1 and "page.md" in capsys.readouterr().out
    assert main(["--docs", str(tmp_path)]) == 0
    assert page.read_text(encoding="utf-8") == f"before\n{good}\nafter\n"
    assert main(["--check", "--docs", str(tmp_path)]) == 0


@pytest.mark.parametrize("name, end", [("weather", "weather"), ("dataset keys", "recording keys")])
def test_a_broken_block_is_refused(name, end):
    with pytest.raises(UserError, match=f"my page: .*{name}"):
        rendered(_block(name, "").replace(f"end of {name}", f"end of {end}"), "my page")


def test_a_folder_without_pages_is_refused(tmp_path, capsys):
    assert main(["--docs", str(tmp_path)]) == 2 and "no pages" in capsys.readouterr().err


def _block(name: str, text: str) -> str:
    return f"<!-- written by python -m thesis_lib.studies.docs: {name} -->\n{text}<!-- end of {name} -->"


@pytest.mark.parametrize("page", [*PAGES, *ROOT.glob("*.md")], ids=lambda path: path.stem)
def test_links_lead_somewhere(page: Path):
    text = page.read_text(encoding="utf-8")
    for target in LINK.findall(text):
        path, _, anchor = target.partition("#")
        if path.startswith(("http", "mailto")):
            continue
        if path:
            assert (page.parent / path).exists(), target
        if anchor:
            there = (page.parent / path if path else page).read_text(encoding="utf-8")
            assert anchor in {_anchor(line) for line in re.findall(r"^#+ (.*)$", there, re.M)}, target


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@EACH_PAGE
def test_pictures_are_there_small_and_described(page: Path):
    for words, path in PICTURE.findall(page.read_text(encoding="utf-8")):
        assert len(words.split()) >= 4, path
        if (page.parent / path).suffix == ".png":
            assert 1_000 < (page.parent / path).stat().st_size < LARGEST, path


def test_every_page_is_in_the_index():
    index = (DOCS / "README.md").read_text(encoding="utf-8")
    linked = set(LINK.findall(index))
    assert {page.name for page in PAGES} - {"README.md"} <= linked
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert {page.name for page in PAGES} == set(re.findall(r" docs/(.*\.md)$", site, re.M))


def test_every_picture_is_on_a_page():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for picture in (DOCS / "pictures").rglob("*.png"):
        assert picture.relative_to(DOCS).as_posix() in text


def test_numbers_drawn_are_those_of_the_code():
    from thesis_lib.studies.docs.pictures import kept_numbers
    from thesis_lib.studies.docs.signatures import signature

    stored = pd.read_csv(DOCS / "pictures/effects/signatures.csv", keep_default_na=False, na_values=[""])
    tables = {name: signature(effect) for name, effect in effects_in(PLANE).items()}
    for name, table in tables.items():
        assert np.isfinite(table["value"]).all(), name
        assert (table["value"].abs().groupby(table["panel"]).max() > 0.0).all(), f"the picture of {name} shows nothing"
    ours = kept_numbers(tables)
    words = ["effect", "panel", "over", "series"]
    assert stored[words].equals(ours[words].astype(stored[words].dtypes))
    for name, rows in ours.groupby("effect"):
        # five digits are stored; steps of a law's branches may fall to either side of a rounding
        size = rows["value"].abs().max()
        there = stored.loc[rows.index, "value"]
        assert (np.abs(there - rows["value"]) <= 1e-3 * size).mean() > 0.98, name


def test_the_picture_of_a_tilt_is_that_of_an_inclined_plane():
    from thesis_lib.studies.docs.signatures import SPAN, signature

    effect = EFFECTS["surface_tilt"]
    table = signature(effect).set_index(["panel", "series"])
    phi = effect.parameters[0].scale
    np.testing.assert_allclose(table.loc[("flight", "a_x"), "value"], 9.81 * np.sin(phi), rtol=1e-9)
    end = table.loc[("path", "x"), "value"].iloc[-1]
    assert end == pytest.approx(0.5 * 9.81 * np.sin(phi) * SPAN**2, rel=1e-6)


def test_the_example_of_the_dataset_page_is_read(tmp_path):
    from thesis_lib.datasets import read_dataset

    page = (DOCS / "reference_dataset.md").read_text(encoding="utf-8")
    example = page.split("## The smallest dataset")[1]
    for name, kind in (("dataset.yaml", "yaml"), ("impacts.csv", "csv")):
        (tmp_path / name).write_text(re.search(rf"```{kind}\n(.*?)```", example, re.S)[1], encoding="utf-8")
    dataset = read_dataset(tmp_path)
    assert dataset.header.body.radius_of_gyration == 0.02858 and len(dataset.impacts) == 3


def test_columns_of_the_dataset_page_are_those_of_the_reader():
    from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE

    page = (DOCS / "reference_dataset.md").read_text(encoding="utf-8")
    poses, impacts = (page.split(f"\n## {name}.csv")[1].split("\n## ")[0] for name in ("trajectories", "impacts"))
    assert _first_cells(poses) == {"trial", "t", *POSE}
    assert _first_cells(impacts) == {"trial", "impact", *POSE, *V_PRE, *V_POST, "t", "r_x", "r_y"}


def _first_cells(text: str) -> set[str]:
    return {name for row in re.findall(r"^\| (`[^|]*) \|", text, re.M) for name in re.findall(r"`(\w+)`", row)}


def test_symbols_of_the_glossary_are_in_the_code_with_their_units():
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "thesis_lib").rglob("*.py"))
    everywhere, _ = meanings()
    rows = re.findall(r"^\| [^|]+ \| ([^|]*`[^|]*) \| ([^|]*) \|", (DOCS / "glossary.md").read_text("utf-8"), re.M)
    assert len(rows) >= 15
    checked = 0
    for names, units in rows:
        names = re.findall(r"`(\w+)`", names)
        for name in names:
            assert re.search(rf"\b{name}\b", code), name
        for name in names:
            if name in everywhere and len(names) == 1 and everywhere[name][0] not in ("", units):
                pytest.fail(f"{name} is in {units} here and in {everywhere[name][0]} in columns.yaml")
            checked += name in everywhere
    assert checked >= 5


@pytest.mark.parametrize("name", [name for name in LAWS if not name.endswith("_as_published")])
def test_a_law_says_where_it_is_from(name):
    page = (DOCS / "reference_laws.md").read_text(encoding="utf-8")
    entry = page.split(f"\n## {LAWS[name].title}\n")[1].split("\n## ")[0]
    assert "Source" in entry and f"`{name}`" in entry
