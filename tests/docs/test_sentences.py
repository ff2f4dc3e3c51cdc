"""Numbers in sentences of README and docs/ are those of stored tables."""

import pytest
from tutorial_runner import ROOT

from thesis_lib.docs.sentences import keep_results, read_sentences, value, with_numbers
from thesis_lib.foundation.errors import UserError

STORED = "config/figures/default/planar_impact/figure_measured_ratio.csv"
SENTENCES = f"""
page.md:
- says: m/I is {{ratio}} ± {{std}} 1/m² once mirrored
  from: {STORED}
  numbers:
    ratio: {{where: variant == 'mirrored_rotation', column: ratio, as: ",.0f"}}
    std: {{where: variant == 'mirrored_rotation', column: -std, as: .1f}}
- says: "{{n}} readings"
  from: {STORED}
  numbers:
    n: {{column: ratio, take: count, as: .0f}}
"""
PAGE = "Our m/I\nis 1 ± −2.5 1/m² once\nmirrored, of 3 readings.\n"


@pytest.fixture
def read(tmp_path):
    def _read(old: str = "", new: str = "") -> dict:
        assert old in SENTENCES
        path = tmp_path / "sentences.yaml"
        path.write_text(SENTENCES.replace(old, new) if old else SENTENCES, encoding="utf-8")
        return read_sentences(path)

    return _read


def test_numbers_are_written_and_words_stay(read):
    written = with_numbers(PAGE, "page.md", read())
    assert written == "Our m/I\nis 2,661 ± −14.3 1/m² once\nmirrored, of 4 readings.\n"
    assert with_numbers(written, "page.md", read()) == written
    assert with_numbers(PAGE, "other.md", read()) == PAGE


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("once mirrored", "once turned", "0 times the words"),
        ("{n} readings", "{m} readings", "do not agree on"),
        ("column: ratio, as", "column: weight, as", "weight"),
        (" == 'mirrored_rotation', column: ratio", " = 'mirrored_rotation', column: ratio", "cannot assign"),
        (STORED, "../secrets.csv", "no file of the repository"),
        ("where: variant == 'mirrored_rotation', column: ratio", "column: ratio", "leaves 4 rows, not one"),
    ],
)
def test_what_is_wrong_is_said(read, old, new, said):
    with pytest.raises(UserError, match=said):
        with_numbers(PAGE, "page.md", read(old, new))


def test_every_mistake_of_the_file_is_told_with_its_line(read):
    with pytest.raises(UserError, match=r"1 mistake:\n- line \d+: .*size: unknown key"):
        read("as: .0f", "as: .0f, size: 3")


def test_words_that_stand_twice_are_refused(read):
    with pytest.raises(UserError, match="2 times the words"):
        with_numbers(PAGE + PAGE, "page.md", read())


def test_tables_of_a_run_are_kept(tmp_path):
    store, results = tmp_path / "sentences.yaml", tmp_path / "run"
    store.write_text(SENTENCES.replace(STORED, "results/chapter2/ratio.csv"), encoding="utf-8")
    copy = tmp_path / "results" / "chapter2" / "ratio.csv"
    with pytest.raises(UserError, match="does not exist; run the rule"):
        keep_results(results, tmp_path, store)
    (results / "chapter2").mkdir(parents=True)
    (results / "chapter2" / "ratio.csv").write_text("ratio\n1\n", encoding="utf-8")
    assert keep_results(results, tmp_path, store) == [copy]
    assert copy.read_text(encoding="utf-8") == "ratio\n1\n"
    assert keep_results(results, tmp_path, store) == []
    (results / "chapter2" / "ratio.csv").unlink()  # as in a run without the dataset
    assert keep_results(results, tmp_path, store) == []
    (results / "chapter2" / "ratio.csv").write_text("1" * 200_000, encoding="utf-8")
    with pytest.raises(UserError, match="at most 100,000"):
        keep_results(results, tmp_path, store)


def test_every_sentence_is_of_a_page_and_has_a_value():
    for page, sentences in read_sentences().items():
        assert (ROOT / page).is_file()
        for sentence in sentences:
            assert all(value(sentence, number) for number in sentence.numbers.values())
