"""How stored results of the proof are counted, held against the targets, named where missed, and drawn."""

import json
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from thesis_lib.columns import explain
from thesis_lib.critique import proof_table
from thesis_lib.critique.proof import NOTHING, SEEDS, Case, truths
from thesis_lib.critique.proof_results import kind_of, outcomes, recovered, wilson
from thesis_lib.critique.proof_summary import TARGETS, median_interval, report, summary, tables
from thesis_lib.critique.proof_table import confusion, misses, rerun
from thesis_lib.errors import CorruptFileError, UserError
from thesis_lib.figures.proof_pictures import NAMES, pictures
from thesis_lib.figures.style import save_figure
from thesis_lib.simulate.mechanisms import CAUSES

FLOOR = 0.01  # m/s
OUTSIDE = next(name for name, cause in CAUSES.items() if not cause.effects)
LAWS_RIGHT, MECHANISMS_RIGHT, SMALL, ADEQUATE, PAIRS, UNEXPLAINED, COVERAGE, MISFIT = (
    target.figure for target in TARGETS
)
ROOT = Path(__file__).parents[2]


def error(before: float = 3.0, after: float = 1.0, **channels: float | None) -> dict:
    """Errors as a result stores them: those of impacts over the floor, and other channels at their floor."""
    others = {f"{c}_{when}": 1.0 for c in ("flight", "touch") for when in ("base", "augmented")}
    return {"base": before * FLOOR, "augmented": after * FLOOR, "floor": FLOOR} | others | channels


def put(folder: Path, case: Case, **content) -> dict:
    """Store a result; what is not given is that of an effect named rightly."""
    steps = content.pop("steps", [[case.truth]])
    fields = {"verdict": "effects" if steps else "adequate", "law": "mirtich", "steps": steps, "right": False}
    fields |= {"parameters": {}, "n_impacts": 300, "error": error(), "remaining_p": 0.4}
    result = asdict(case) | fields | content
    path = folder / case.path
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result))
    return result


def refuse(folder: Path, case: Case, why: str = "too few impacts") -> None:
    path = folder / case.path
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(asdict(case) | {"verdict": "refused", "why": why}))


def cell(store: Path, source: str, truth: str) -> pd.Series:
    table = confusion(store)
    (row,) = [row for _, row in table.iterrows() if (row["source"], row["truth"]) == (source, truth)]
    return row


def figure_of(store: Path, figure: str, source: str) -> pd.Series:
    table = summary(store)
    (row,) = [row for _, row in table.iterrows() if (row["figure"], row["source"]) == (figure, source)]
    return row


class TestWilson:
    def test_is_scipy_s(self):
        for k, n in ((0, 10), (3, 10), (7, 10), (10, 10), (190, 200)):
            assert wilson(k, n) == pytest.approx(binomtest(k, n).proportion_ci(method="wilson"), abs=1e-12)

    def test_a_number_worked_out_by_hand(self):
        # z² = 3.8415: (7 + 1.9207 ± 1.95996 √(7·3/10 + 0.9604)) / 13.8415
        assert wilson(7, 10) == pytest.approx((0.39678, 0.89221), abs=5e-6)

    def test_of_nothing_is_unknown(self):
        assert np.isnan(wilson(0, 0)).all()


class TestWhatIsRight:
    def test_an_effect_in_the_group_named_first(self, tmp_path):
        put(tmp_path, Case("law", "wear", 1000), right=True)
        put(tmp_path, Case("law", "wear", 1001), right=True, steps=[["wrong_size", "wear"]])
        put(tmp_path, Case("law", "wear", 1002), steps=[["magnus"], ["wear"]])
        put(tmp_path, Case("law", "wear", 1003), steps=[])
        row = cell(tmp_path, "law", "wear")
        assert (row["n"], row["right"]) == (4, 0.5)
        assert (row["right_low"], row["right_high"]) == pytest.approx(wilson(2, 4))
        assert row["group_size"] == pytest.approx(4.0 / 3.0)
        assert row["named_first"] == "magnus:1;wear:1;wrong_size:1"
        assert row["verdicts"] == "adequate:1;effects:3"

    def test_not_in_a_group_of_four(self, tmp_path):
        put(
            tmp_path,
            Case("law", "wear", 1000),
            right=True,
            steps=[["magnus", "adhesion", "wrong_size", "wear"]],
        )
        assert not outcomes(tmp_path)["right"].any()

    def test_only_the_first_group_of_a_single_effect_counts(self, tmp_path):
        four = ["magnus", "adhesion", "wrong_size", "com_offset"]
        put(tmp_path, Case("law", "wear", 1000), right=True, steps=[["wear"], four])
        (row,) = outcomes(tmp_path).itertuples()
        assert row.right and row.group_size == 1.0

    @pytest.mark.parametrize(
        ("steps", "right"),
        [
            ([["com_offset"], ["linear_drag"]], True),
            ([["linear_drag", "magnus"], ["wear", "com_offset"]], True),
            ([["com_offset"], ["wear"], ["linear_drag"]], True),
            # one group says "one or the other", which is not both
            ([["com_offset", "linear_drag"]], False),
            ([["com_offset", "linear_drag"], ["wear"]], False),
        ],
    )
    def test_both_of_a_pair_in_groups_of_their_own(self, tmp_path, steps, right):
        put(tmp_path, Case("mechanism", "com_offset_x+linear_drag", 1000), right=True, steps=steps)
        assert outcomes(tmp_path)["right"].tolist() == [right]

    def test_a_pair_of_which_one_is_named_is_wrong(self, tmp_path):
        put(tmp_path, Case("law", "com_offset+linear_drag", 1000), right=False, steps=[["com_offset"]])
        assert not outcomes(tmp_path)["right"].any()

    def test_adequate_where_nothing_is_hidden_and_unexplained_outside_the_library(self, tmp_path):
        for seed, steps in enumerate(([], [], [["wear"]])):
            put(tmp_path, Case("law", NOTHING, 1000 + seed), steps=steps)
        for seed, verdict in enumerate(("unexplained", "effects", "adequate", "adequate")):
            put(tmp_path, Case("drake", OUTSIDE, 1000 + seed), verdict=verdict, steps=[])
        assert cell(tmp_path, "law", NOTHING)["right"] == pytest.approx(2.0 / 3.0)
        assert cell(tmp_path, "drake", OUTSIDE)["right"] == 0.25
        assert cell(tmp_path, "drake", OUTSIDE)["kind"] == "outside"

    def test_never_a_refusal(self, tmp_path):
        for i, (source, truth) in enumerate((("law", NOTHING), ("law", "wear"), ("mechanism", OUTSIDE))):
            refuse(tmp_path, Case(source, truth, 1000 + i))
        found = outcomes(tmp_path)
        assert len(found) == 3 and not found["right"].any()
        assert confusion(tmp_path)["verdicts"].tolist() == ["refused:1"] * 3


class TestMisfits:
    @pytest.mark.parametrize(
        ("truth", "errors", "after"),
        [
            ("wear", error(after=1.1, flight_augmented=9.0), 1.1),  # acts on impacts only
            ("magnus", error(after=9.0, flight_augmented=1.2), 1.2),  # in flight only
            ("surface_height", error(after=9.0, flight_augmented=9.0, touch_augmented=0.8), 0.8),
            ("com_offset", error(after=1.1, flight_augmented=1.3), 1.3),  # both: the worse
            ("com_offset", error(after=1.4, flight_augmented=1.3), 1.4),
            ("com_offset", error(after=1.4, flight_augmented=None), 1.4),  # no flights to judge by
        ],
    )
    def test_count_where_the_effect_acts(self, tmp_path, truth, errors, after):
        put(tmp_path, Case("law", truth, 1000), right=True, error=errors)
        assert cell(tmp_path, "law", truth)["after_over_floor"] == pytest.approx(after)

    def test_of_a_cause_are_those_of_the_effect_that_describes_it(self, tmp_path):
        put(
            tmp_path,
            Case("mechanism", "gravity_error", 1000),
            error=error(flight_base=4.0, flight_augmented=1.5),
        )
        row = cell(tmp_path, "mechanism", "gravity_error")
        assert (row["before_over_floor"], row["after_over_floor"]) == (4.0, 1.5)

    def test_medians_over_datasets(self, tmp_path):
        for i, after in enumerate((1.0, 1.1, 5.0)):
            put(tmp_path, Case("law", "wear", 1000 + i), error=error(after=after))
        row = cell(tmp_path, "law", "wear")
        assert row["after_over_floor"] == pytest.approx(1.1) and row["before_over_floor"] == pytest.approx(
            3.0
        )
        assert row["error_after"] == pytest.approx(1.1 * FLOOR) and row["floor"] == FLOOR


def parameter(z: float, width: float | None = 1.1) -> dict:
    """A stored parameter whose distance from the truth is z standard errors."""
    return {"true": 2.0, "found": 2.0 + 0.3 * z, "std": 0.3, "fisher": 0.3 / width if width else None}


class TestParameters:
    def test_coverage_distance_and_width(self, tmp_path):
        for i, z in enumerate((0.5, -1.0, 1.9, -2.0)):
            put(
                tmp_path,
                Case("law", "wear", 1000 + i),
                right=True,
                parameters={"w": parameter(z, 1.0 + 0.1 * i)},
            )
        row = cell(tmp_path, "law", "wear")
        assert (row["n_parameters"], row["coverage"]) == (4, 0.75)
        assert (row["coverage_low"], row["coverage_high"]) == pytest.approx(wilson(3, 4))
        assert row["z"] == pytest.approx(1.45) and row["width"] == pytest.approx(1.15)

    def test_an_unknown_bound_leaves_the_width_open(self, tmp_path):
        put(tmp_path, Case("law", "wear", 1000), right=True, parameters={"w": parameter(0.1, None)})
        row = cell(tmp_path, "law", "wear")
        assert row["coverage"] == 1.0 and np.isnan(row["width"])
        # and what is not known to be narrow does not meet a target that asks for it
        assert figure_of(tmp_path, COVERAGE, "law")["met"] == "missed"

    def test_none_where_the_effect_was_not_named(self, tmp_path):
        put(tmp_path, Case("law", "wear", 1000), steps=[])
        row = cell(tmp_path, "law", "wear")
        assert row["n_parameters"] == 0 and np.isnan(row["coverage"]) and np.isnan(row["coverage_low"])
        assert recovered(tmp_path).empty


def many(folder: Path, source: str, truth: str, right: int, wrong: int, **size) -> None:
    for i in range(right + wrong):
        put(
            folder,
            Case(source, truth, SEEDS + i, **size),
            right=i < right,
            steps=[[truth]] if i < right else [],
        )


class TestSummary:
    def test_without_results_every_figure_is_not_run(self, tmp_path):
        table = summary(tmp_path)
        assert set(table["met"]) == {"not run"} and (table["n"] == 0).all() and table["measured"].isna().all()
        assert list(dict.fromkeys(table["figure"])) == [target.figure for target in TARGETS]
        assert len(TARGETS) == 8

    def test_targets_are_those_that_were_set(self, tmp_path):
        said = summary(tmp_path).drop_duplicates("figure")[["at_least", "aim"]].to_numpy().tolist()
        assert said == [
            ["95 %", "99 %"],
            ["85 %", "95 %"],
            ["70 %", "90 %"],
            ["95 %", "99 %"],
            ["80 %", "95 %"],
            ["80 %", "95 %"],
            ["90 %", "94-96 %"],
            ["≤ 1.2", "≤ 1.05"],
        ]

    @pytest.mark.parametrize(
        ("right", "met"), [(100, "aim"), (99, "aim"), (98, "at least"), (95, "at least"), (94, "missed")]
    )
    def test_a_share_meets_its_aim_its_least_or_neither(self, tmp_path, right, met):
        many(tmp_path, "law", "wear", right, 100 - right)
        row = figure_of(tmp_path, LAWS_RIGHT, "law")
        assert (row["n"], row["measured"], row["met"]) == (100, right / 100, met)
        assert (row["low"], row["high"]) == pytest.approx(wilson(right, 100))
        assert row["group_size"] == 1.0

    def test_mechanisms_are_pooled_and_each(self, tmp_path):
        many(tmp_path, "mechanism", "tilt", 9, 1)
        many(tmp_path, "drake", "tilt", 2, 8)
        measured = {
            s: figure_of(tmp_path, MECHANISMS_RIGHT, s) for s in ("mechanism + drake", "mechanism", "drake")
        }
        assert [row["measured"] for row in measured.values()] == pytest.approx([0.55, 0.9, 0.2])
        assert [row["met"] for row in measured.values()] == ["missed", "at least", "missed"]
        assert figure_of(tmp_path, LAWS_RIGHT, "law")["met"] == "not run"

    def test_other_sizes_drops_and_noises_do_not_count(self, tmp_path):
        for size in ({"ratio": 6.0}, {"ratio": 1.5}, {"noise": 5.0}, {"drops": 300}):
            many(tmp_path, "mechanism", "tilt", 3, 0, **size)
        assert set(summary(tmp_path)["met"]) == {"not run"}
        many(tmp_path, "mechanism", "tilt", 3, 1, drops=50)
        assert figure_of(tmp_path, SMALL, "mechanism")["measured"] == 0.75
        assert figure_of(tmp_path, MECHANISMS_RIGHT, "mechanism")["met"] == "not run"
        assert len(confusion(tmp_path)) == 5

    def test_each_kind_has_its_own_figure(self, tmp_path):
        put(tmp_path, Case("law", NOTHING, 1000), steps=[])
        put(tmp_path, Case("mechanism", OUTSIDE, 1000), steps=[], verdict="unexplained")
        put(tmp_path, Case("law", "wear+magnus", 1000), right=True, steps=[["wear"], ["magnus", "tilt"]])
        table = summary(tmp_path)
        run = table[table["n"] > 0]
        assert run[["figure", "source"]].to_numpy().tolist() == [
            [ADEQUATE, "law"],
            [PAIRS, "all"],
            [PAIRS, "law"],
            [UNEXPLAINED, "mechanism + drake"],
            [UNEXPLAINED, "mechanism"],
        ]
        assert (run["met"] == "aim").all()
        assert figure_of(tmp_path, PAIRS, "law")["group_size"] == 1.5

    def test_says_how_many_datasets_were_planned(self, tmp_path):
        table = summary(tmp_path).set_index(["figure", "source"])["n_asked"]
        singles = [name for name in truths("mechanism") if kind_of("mechanism", name) == "single"]
        assert table[MECHANISMS_RIGHT, "mechanism"] == 10 * len(singles)
        assert table[ADEQUATE, "law"] == 200 and table[SMALL, "mechanism"] == 24
        assert table[PAIRS, "all"] == 100 and table[UNEXPLAINED, "mechanism + drake"] == 30

    @pytest.mark.parametrize(
        ("covered", "width", "met"),
        [
            (95, 1.1, "aim"),
            (95, 1.31, "missed"),
            (100, 1.1, "at least"),
            (91, 1.1, "at least"),
            (89, 1.1, "missed"),
        ],
    )
    def test_coverage_counts_only_with_narrow_intervals(self, tmp_path, covered, width, met):
        for i in range(100):
            values = {"w": parameter(1.0 if i < covered else 3.0, width)}
            put(tmp_path, Case("law", "wear", 1000 + i), right=True, parameters=values)
        row = figure_of(tmp_path, COVERAGE, "law")
        assert (row["measured"], row["n"], row["met"]) == (covered / 100, 100, met)
        assert f"{width:.2f}" in row["note"]

    @pytest.mark.parametrize(("after", "met"), [(1.04, "aim"), (1.1, "at least"), (1.3, "missed")])
    def test_the_misfit_is_the_median_over_single_effects(self, tmp_path, after, met):
        for i in range(9):
            put(tmp_path, Case("law", "wear", 1000 + i), right=True, error=error(after=after if i else 0.9))
        for i in range(3):
            put(tmp_path, Case("law", "wrong_inertia", 1000 + i), error=error(after=4.0))
        put(tmp_path, Case("law", NOTHING, 1000), steps=[], error=error(after=0.1))
        row = figure_of(tmp_path, MISFIT, "law")
        assert row["measured"] == pytest.approx(after) and row["met"] == met and row["n"] == 12
        assert "worst wrong_inertia 4.00" in row["note"]
        assert row["note"].startswith("75 % of" if after <= 1.2 else "8 % of")

    def test_the_median_s_interval_covers_as_often_as_it_says(self):
        rng = np.random.default_rng(4)
        covered = 0
        for _ in range(400):
            low, high = median_interval(rng.exponential(size=41))
            covered += low <= np.log(2.0) <= high
        # exact coverage of these order statistics is 0.965; 400 draws know it to 0.01
        assert 0.93 < covered / 400 < 0.99
        assert median_interval(np.array([3.0, 1.0, 2.0])) == (1.0, 3.0)


@pytest.fixture
def mixed(tmp_path) -> Path:
    """A store with a bit of everything."""
    store = tmp_path / "store"
    many(store, "law", "tangential_restitution", 3, 0)
    many(store, "law", "wear", 2, 1, ratio=6.0)
    many(store, "law", "wear", 3, 0, drops=50)
    for i in range(3):
        values = {"w": parameter(0.5 * i)}
        put(
            store,
            Case("law", "wear", 1000 + i),
            right=True,
            steps=[["wear", "wrong_size"]],
            parameters=values,
        )
    put(store, Case("law", "wear", 1003), steps=[["wrong_size"], ["magnus", "wear"]])
    put(store, Case("law", NOTHING, 1000), steps=[])
    put(store, Case("law", "wear+magnus", 1007), steps=[["wear"]])
    put(store, Case("mechanism", OUTSIDE, 1001), steps=[["adhesion"]])
    refuse(store, Case("drake", "tilt", 1002), "no impact was found")
    return store


class TestMisses:
    def test_every_wrong_dataset_of_the_table_is_named(self, mixed):
        table = misses(mixed).set_index(["source", "truth", "seed"])
        assert set(table.index) == {
            ("law", "wear", 1003),
            ("law", "wear+magnus", 1007),
            ("mechanism", OUTSIDE, 1001),
            ("drake", "tilt", 1002),
        }
        assert table.loc[("law", "wear", 1003), "named"] == "wrong_size + magnus/wear"
        assert table.loc[("drake", "tilt", 1002), "why"] == "no impact was found"

    def test_none_where_all_is_right(self, tmp_path):
        many(tmp_path, "law", "wear", 4, 0)
        assert misses(tmp_path).empty


class TestReport:
    def test_is_readable_in_120_columns_and_holds_everything(self, mixed):
        text = report(mixed)
        assert max(map(len, text.splitlines())) <= 120
        for part in ("not run", "missed", "law/wear 1003", "no impact was found", OUTSIDE, "wear+magnus"):
            assert part in text
        for target in TARGETS:
            assert target.figure in text
        # every cell of the confusion table has its line of numbers
        assert len(re.findall(r"(?m)\d \[\d+, \d+\](?: |$)", text.split("Truth against verdict")[1])) == len(
            confusion(mixed)
        )

    def test_long_lists_of_names_say_what_is_left_out(self, tmp_path):
        from thesis_lib.effects import EFFECTS

        for i, name in enumerate(EFFECTS):
            put(tmp_path, Case("law", "wear", 1000 + i), steps=[[name]], right=name == "wear")
        text = report(tmp_path)
        assert max(map(len, text.splitlines())) <= 120 and re.search(r", and \d+ more", text)

    def test_of_an_empty_store(self, tmp_path):
        assert "not run" in report(tmp_path / "nowhere")

    def test_writes_the_tables(self, mixed, tmp_path):
        report(mixed, tmp_path / "csv")
        assert sorted(path.name for path in (tmp_path / "csv").iterdir()) == [
            "confusion.csv",
            "misses.csv",
            "summary.csv",
        ]
        for name, table in tables(mixed).items():
            pd.testing.assert_frame_equal(
                pd.read_csv(tmp_path / "csv" / f"{name}.csv", keep_default_na=False, na_values=[""])[
                    ["source"]
                ],
                table[["source"]],
            )


class TestBadStores:
    @pytest.mark.parametrize("missing", ["ratio", "steps_of_right", "error", "verdict"])
    def test_a_result_that_lacks_something_is_named(self, tmp_path, missing):
        case = Case("law", "wear", 1000)
        result = put(tmp_path, case, right=True)
        del result["right" if missing == "steps_of_right" else missing]
        (tmp_path / case.path).write_text(json.dumps(result))
        with pytest.raises(CorruptFileError, match=r"1000\.json is no result of the proof"):
            confusion(tmp_path)

    def test_an_unknown_truth_is_named(self, tmp_path):
        put(tmp_path, Case("law", "wear", 1000), truth="phlogiston")
        with pytest.raises(CorruptFileError, match="phlogiston"):
            outcomes(tmp_path)

    def test_what_is_no_json_is_named(self, tmp_path):
        (tmp_path / "1000.json").write_text("{")
        with pytest.raises(CorruptFileError, match=r"1000\.json is not valid JSON"):
            outcomes(tmp_path)


class TestRerun:
    @pytest.fixture
    def store(self, tmp_path, monkeypatch) -> Path:
        put(tmp_path, Case("law", "wear", SEEDS), right=True)
        refuse(tmp_path, Case("law", NOTHING, SEEDS))
        monkeypatch.setattr(
            proof_table, "run", lambda case, folder: json.loads((tmp_path / case.path).read_text())
        )
        return tmp_path

    def test_agrees_with_what_is_stored(self, store):
        table = rerun(["law/wear", f"law/{NOTHING}"], store)
        assert table["agrees"].tolist() == [1, 1] and table["verdict"].tolist() == ["effects", "refused"]

    @pytest.mark.parametrize("change", [{"verdict": "unexplained"}, {"steps": [["magnus"]]}])
    def test_another_answer_is_refused(self, store, monkeypatch, change):
        run = proof_table.run
        monkeypatch.setattr(proof_table, "run", lambda case, folder: run(case, folder) | change)
        with pytest.raises(UserError, match="law/wear"):
            rerun(["law/wear"], store)

    def test_of_what_is_not_stored_says_how_to_make_it(self, store):
        with pytest.raises(UserError, match="--source law --truths magnus"):
            rerun(["law/magnus"], store)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    store = tmp_path_factory.mktemp("drawn")
    for i in range(4):
        values = {"w": parameter(1.0 if i else 3.0)}
        named = [["wear", "wrong_size"]] if i else [["magnus"]]
        put(store, Case("law", "wear", 1000 + i), right=i > 0, steps=named, parameters=values)
        put(store, Case("law", "wear", 1000 + i, ratio=1.5), right=i > 2, steps=[["wear"]])
        put(store, Case("law", "wear", 1000 + i, drops=50, noise=5.0), right=i > 1)
        put(store, Case("mechanism", "com_offset_x", 1000 + i), right=True, steps=[["com_offset"]])
        put(store, Case("mechanism", "com_offset_y", 1000 + i), steps=[])
    put(store, Case("law", NOTHING, 1000), steps=[])
    refuse(store, Case("law", NOTHING, 1001))
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
