"""Pictures of the proof: the numbers drawn, and that each has its files and its line in the pipeline."""

import re
from pathlib import Path

import pytest
from stored_proof import parameter, put, refuse

from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.columns import explain
from thesis_lib.statistics.intervals import wilson
from thesis_lib.studies.figures.pictures import NAMES, pictures
from thesis_lib.studies.proof.cases import Case
from thesis_lib.studies.proof.results import outcomes, recovered
from thesis_lib.studies.proof.store import NOTHING

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    store = tmp_path_factory.mktemp("drawn")
    for i in range(4):
        values = parameter(1.0 if i else 3.0)
        put(store, Case("law", "wear", 1000 + i), [["wear", "wrong_size"]] if i else [["magnus"]], parameters=values)
        put(store, Case("law", "wear", 1000 + i, ratio=1.5), [["wear"]] if i > 2 else [["magnus"]])
        put(store, Case("law", "wear", 1000 + i, drops=50, noise=5.0), None if i > 1 else [["magnus"]])
        put(store, Case("mechanism", "com_offset_x", 1000 + i), [["com_offset"]])
        put(store, Case("mechanism", "com_offset_y", 1000 + i), [])
    put(store, Case("law", NOTHING, 1000))
    refuse(store, Case("law", NOTHING, 1001))
    # drops of real contacts have tables of their own
    put(store, Case("mujoco", "wear", 1000), [["wear"]])
    put(store, Case("mechanism", "com_offset_x", 1000, shape="square", contact_time=0.001), [["com_offset"]])
    return pictures(outcomes(store), recovered(store))


class TestPictures:
    def test_the_matrix_holds_shares_of_what_was_named_first(self, drawn):
        table = drawn["matrix_law"][1].set_index(["truth", "column"])
        shares = table["share"][table["share"] > 0.0].to_dict()
        assert shares == {
            ("wear", "wear"): 0.75,
            ("wear", "magnus"): 0.25,
            (NOTHING, "adequate"): 0.5,
            (NOTHING, "refused"): 0.5,
        }
        assert (table.groupby("truth")["share"].sum() == 1.0).all()
        assert table.loc[("wear", "wear"), "right"] == 0.75

    def test_two_causes_of_one_effect_share_a_point(self, drawn):
        table = drawn["detection"][1]
        (row,) = table[table["source"] == "mechanism"].itertuples()
        assert (row.effect, row.n, row.right) == ("com_offset", 8, 0.5)
        laws = table[table["source"] == "law"].set_index("ratio")
        assert laws["right"].to_dict() == {1.5: 0.25, 3.0: 0.75}
        assert laws.loc[3.0, "right_low"] == pytest.approx(wilson(3, 4)[0])

    def test_sizes_are_drawn_for_effects_that_were_run_at_other_sizes(self, drawn):
        table = drawn["sizes"][1]
        assert set(table["effect"]) == {"wear"}
        assert table.set_index(["drops", "noise"])["right"].to_dict() == {(50, 5.0): 0.5, (150, 1.0): 0.75}

    def test_misfits_and_parameters_are_those_of_the_table(self, drawn):
        misfit = drawn["misfits"][1].set_index(["source", "effect", "series"])
        assert misfit.loc[("law", "wear", "before"), "median"] == pytest.approx(3.0)
        assert misfit.loc[("law", "wear", "after"), "n"] == 4
        (row,) = drawn["recovery"][1].itertuples()
        assert (row.effect, row.parameter, row.n, row.coverage) == ("wear", "w", 4, 0.75)
        assert row.width == pytest.approx(1.1)

    @pytest.mark.slow
    def test_every_column_is_explained_and_every_file_written(self, drawn, tmp_path):
        assert tuple(drawn) == NAMES
        for name, (figure, table) in drawn.items():
            save_figure(figure, table, tmp_path / name)
            assert {path.suffix for path in tmp_path.glob(f"{name}.*")} == {".png", ".pdf", ".csv"}

    def test_an_empty_store_is_said_and_not_an_error(self, tmp_path):
        for name, (figure, table) in pictures(outcomes(tmp_path), recovered(tmp_path)).items():
            assert table.empty
            explain(name, table.columns)
            assert any("no stored results" in text.get_text() for text in figure.texts)

    def test_the_rule_lists_every_picture(self):
        text = (ROOT / "workflow/rules/critique.smk").read_text(encoding="utf-8")
        listed = re.search(r"PROOF_PICTURES = \((.*?)\)", text, re.DOTALL)[1]
        assert tuple(re.findall(r'^    "(\w+)",', listed, re.MULTILINE)) == NAMES
