"""A dataset from a stranger is criticised from the command line, as a user would, and nothing of it gets out."""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hostile_datasets import BROKEN, DESCRIPTION, ESCAPES, NAME, ORDERS, broken_folder, valid_folder

from thesis_lib.__main__ import main
from thesis_lib.commands.datasets import main as datasets_main
from thesis_lib.foundation.command_line import command
from thesis_lib.foundation.terminal import VisibleStream, visible
from thesis_lib.report.critique.page import script

ROOT = Path(__file__).resolve().parents[2]
# all that the page is made of; none of them can run or load anything but `img`, whose source is looked at
TAGS = {
    *("html", "head", "meta", "title", "style", "body", "main", "nav", "section", "div", "span", "a", "p", "br"),
    *("h1", "h2", "h3", "ul", "li", "dl", "dt", "dd", "figure", "figcaption", "img", "strong", "em", "small"),
    *("table", "caption", "thead", "tbody", "tr", "th", "td", "details", "summary"),
    *("header", "noscript", "svg", "g", "circle", "path", "text"),
    # switches and what is replayed, which send nothing: the page has no form
    *("fieldset", "legend", "label", "input", "output", "select", "option", "button"),
}
OWN_SCRIPT = script()


class Page(HTMLParser):
    """Tags, attributes and text of a page."""

    def __init__(self, text: str):
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


def without_own_script(text: str) -> str:
    """A page without the program's own script, the numbers that it draws, and the policy that allows no other."""
    numbers = re.compile(r'<script type="application/json">([^<]*)</script>')
    assert all(json.loads(found) for found in numbers.findall(text)) and numbers.search(text)
    digest = base64.b64encode(hashlib.sha256(OWN_SCRIPT.encode()).digest()).decode()
    assert f"default-src 'none'; script-src 'sha256-{digest}';" in text
    assert text.count(f"<script>{OWN_SCRIPT}</script>") == 1
    return numbers.sub("", text.replace(f"<script>{OWN_SCRIPT}</script>", ""))


def harmless(page: Page) -> None:
    assert {tag for tag, _ in page.tags} <= TAGS
    for tag, attributes in page.tags:
        assert not [name for name in attributes if name.startswith("on")], tag
        for name in ("src", "href", "action", "data", "srcset"):
            value = attributes.get(name) or "#"
            assert value.startswith(("#", "data:image/png;base64,")), (tag, name, value[:80])


@pytest.mark.parametrize(
    "bad", ["<script>1</script>", "<img src=x>", "<p onclick='x'>", "<a href='javascript:1'>a</a>", "<iframe></iframe>"]
)
def test_the_check_of_the_page_can_fail(bad):
    harmless(Page("<p>a &lt;script&gt;</p><img src='data:image/png;base64,aa'>"))
    with pytest.raises(AssertionError):
        harmless(Page(bad))


def everything_below(folder: Path) -> dict[str, bytes]:
    return {os.path.relpath(path, folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_a_hostile_dataset_is_criticised_and_nothing_of_it_gets_out(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    folder = valid_folder(data)
    before = everything_below(tmp_path)
    work = tmp_path / "work"
    work.mkdir()
    command = ("critique", str(folder), "-o", "out/run", "--effect", "wrong_inertia")
    own = {"PYTHONPATH": str(ROOT), "MPLCONFIGDIR": str(tmp_path / "config"), "TERM": "xterm-256color"}
    done = subprocess.run(
        [sys.executable, "-m", "thesis_lib", *command], cwd=work, env=os.environ | own, capture_output=True
    )
    terminal = (done.stdout + done.stderr).decode("utf-8")
    assert done.returncode == 0, terminal
    assert not [order for order in ORDERS if order in terminal]
    assert NAME in done.stdout.decode()  # told as it is

    # all that was written lies in the output folder, and nothing else was touched or made
    shutil.rmtree(tmp_path / "config", ignore_errors=True)
    after = everything_below(tmp_path)
    assert {name: after[name] for name in before} == before
    assert {name for name in set(after) - set(before) if not name.startswith("work/out/run/")} == set()
    assert "pwned" not in {Path(name).name for name in after}

    out = work / "out" / "run"
    report = without_own_script((out / "report.html").read_text(encoding="utf-8"))
    page = Page(report)
    harmless(page)
    assert f"Critique of {NAME}" in page.text
    assert json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))["dataset"] == NAME
    assert "alert(2)" in page.text  # the description, as text
    for path in out.iterdir():
        content = report.encode() if path.name == "report.html" else path.read_bytes()
        assert b"<script" not in content, path.name
        if path.suffix == ".pdf":
            assert not re.search(rb"/(JavaScript|JS|OpenAction|Launch|URI|EmbeddedFile)\b", content), path.name
    for name in ("diagnosis.json", "model.json", "where.json", "report.html"):
        text = (out / name).read_text(encoding="utf-8")
        assert not [order for order in ORDERS if order in text], name


@pytest.mark.parametrize("which", BROKEN)
@pytest.mark.parametrize("run", [main, datasets_main], ids=["critique", "check"])
def test_a_broken_dataset_is_refused_without_orders_to_the_terminal(which, run, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = broken_folder(tmp_path, which)
    assert run(["critique" if run is main else "check", str(folder)]) == 2
    shown = capsys.readouterr()
    said = shown.out + shown.err
    assert "dataset.yaml" in said or "trajectories.csv" in said
    assert not [order for order in ORDERS if order in said]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken"]


def forged_run(folder: Path, text: str) -> Path:
    """What a critique writes, with a text of a stranger wherever a text stands."""
    value = {"value": 0.1, "std": 0.01, "unit": text}
    model = {"name": text, "parameters": {"mu": value, "epsilon": value, text: value}}
    error = {"unit": text, "base": 0.1, "augmented": 0.1, "noise_floor": 0.1, "irb_bound": 0.1}
    effect = {"name": text, "parameters": {text: value}, "indistinguishable_from": [text], "clears": True}
    content = {
        **{"schema": 1, "dataset": text, "verdict": text, "summary": [text], "effects": [effect], "laws": {}},
        **{"base_model": model, "augmented_model": model, "error": error},
    }
    folder.mkdir()
    (folder / "diagnosis.json").write_text(json.dumps(content), encoding="utf-8")
    return folder


@pytest.mark.parametrize("json_too", [(), ("--json",)], ids=["text", "json"])
def test_forged_results_give_no_orders_to_the_terminal(json_too, tmp_path, capsys):
    runs = [str(forged_run(tmp_path / name, f"{name}{ESCAPES}")) for name in ("one", "two")]
    assert main(["critique", *runs, *json_too]) == 0
    shown = capsys.readouterr()
    assert "one" in shown.out and "31mred" in shown.out
    assert not [order for order in ORDERS if order in shown.out + shown.err]


@pytest.mark.parametrize("name", [ESCAPES, "two\nlines", "\u202ecod.exe", "not\udcfftext", "tab\there"])
def test_a_folder_whose_name_does_not_print_is_refused(name, tmp_path, capsys):
    folder = valid_folder(tmp_path, name)
    assert main(["critique", str(folder), "-o", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "rename the folder" in said and ascii(name)[1:-1] in said
    assert not [order for order in ORDERS if order in said]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["../../etc", "a/b", "..", "/etc", "A b", "x;touch pwned", "a$(b)", "a\n", ""])
@pytest.mark.parametrize("section", ["critique", "chapter3", "chapter4"])
def test_names_in_the_configuration_are_no_paths_or_commands(name, section):
    from thesis_lib.foundation.errors import UserError
    from thesis_lib.thesis.config import parse_config

    parse_config({section: {"datasets": ["my_drops"]}})
    with pytest.raises(UserError, match=section):
        parse_config({section: {"datasets": [name]}})


@pytest.mark.parametrize(
    "text", ["plain ± μ – “é”\n\tnext", *(f"a{order}b" for order in ORDERS), DESCRIPTION, "\ud800", "\u2028", "\xa0"]
)
def test_visible_text_prints_and_plain_text_stays(text):
    shown = visible(text)
    assert all(c.isprintable() or c in "\n\t" for c in shown)
    shown.encode("utf-8")
    assert visible(shown) == shown
    if text.startswith("plain"):
        assert shown == text
    elif text == "\xa0":
        assert shown == " "  # between a number and its unit
    elif len(text) == 3:
        assert shown == f"a{ascii(text[1])[1:-1]}b"


def test_a_command_that_prints_orders_shows_them(capsys):
    @command
    def show(text: str) -> int:
        print(text)
        print(text, file=sys.stderr)
        assert isinstance(sys.stdout, VisibleStream) and sys.stdout.encoding
        return 3

    assert show(f"{ESCAPES}, μ") == 3
    shown = capsys.readouterr()
    assert shown.out == shown.err == visible(ESCAPES) + ", μ\n"
    assert not isinstance(sys.stdout, VisibleStream)
