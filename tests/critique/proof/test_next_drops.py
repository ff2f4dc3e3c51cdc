"""The next experiment: states that no refit follows, launchers that meet them, and what the stored questions show."""

import numpy as np
import pytest

from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.questions.next_experiment import CHANNELS, REPEATS, _design, _Refit, next_experiment
from thesis_lib.foundation.errors import CorruptFileError
from thesis_lib.foundation.randomness import generator
from thesis_lib.report.critique.tables import states_table
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, CompliantContact
from thesis_lib.studies.figures.curves import draw_next_drops
from thesis_lib.studies.proof import next_drops
from thesis_lib.studies.proof.cases import Case, make

STORED = 5  # questions, of the 20 that are wanted: `next` goes on
NUMBERS = 1e-5  # relative: six digits are stored


def example(question: next_drops.Question, random: float, chosen: float, **more) -> dict:
    settled = {"effect": "com_offset", "rival": "wrong_size", "apart": 1.5, "sigmas": 0.8, "random": random}
    return vars(question) | settled | {"chosen": chosen, "wrong_random": 0, "wrong_chosen": 0} | more


def test_a_difference_that_a_refit_follows_tells_nothing() -> None:
    """Two states differ much but along a slope of the rival, two little but across it: these are chosen."""
    J = np.zeros((4, 3, 1))
    J[:2, 0, 0] = 1.0
    d = np.array([[5.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.9, 0.0]])
    refit = _Refit(d, J, np.array([[1e-6]]))
    np.testing.assert_allclose(refit.gains([]), [0.0, 0.0, 0.5 * REPEATS, 0.5 * REPEATS * 0.81], atol=1e-4)
    states = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    rows, told = _design(states, (refit, refit))
    assert list(rows[:2]) == [2, 3] and told[0] == pytest.approx(1.0, abs=1e-4)
    # what the data at hand fix, the rival cannot follow: then the large differences tell most
    fixed = _Refit(d, J, np.array([[1e6]]))
    rows, told = _design(states, (fixed, fixed))
    assert set(rows[:2]) == {0, 1} and told[0] == pytest.approx(5.0, rel=1e-3)
    # and what only one of the two models could follow tells no more than the other direction leaves
    assert _design(states, (refit, fixed))[1][0] <= 1.0 + 1e-3


def test_gains_are_those_of_a_least_squares_fit() -> None:
    rng = np.random.default_rng(3)
    d, J = rng.standard_normal((6, 3)), rng.standard_normal((6, 3, 2))
    L = rng.standard_normal((2, 2))
    refit, rows = _Refit(d, J, L @ L.T), [4, 1]
    A = np.concatenate([L.T, *(np.sqrt(REPEATS) * J[i] for i in rows)])
    b = np.concatenate([np.zeros(2), *(np.sqrt(REPEATS) * d[i] for i in rows)])
    residual = b - A @ np.linalg.lstsq(A, b, rcond=None)[0]
    assert refit.gains([4])[1] == pytest.approx(0.5 * residual @ residual, rel=1e-9)


def test_a_launcher_meets_the_states_within_its_scatter() -> None:
    wanted = [
        {"vx": 0.7, "vy": -2.2, "omega": 6.0, "theta": 0.8},
        {"vx": -0.4, "vy": -2.8, "omega": -3.0, "theta": -1.2, "x": 0.12},
    ]
    made = simulate_compliant_drops(
        ELLIPSE_BODY,
        next_drops.Launcher(wanted, ELLIPSE_BODY),  # pyright: ignore[reportArgumentType]
        200,
        contact=CompliantContact(contact_time=2e-5),
        duration=0.5,
        rate=50.0,
        rng=np.random.default_rng(2),
    ).impacts
    first = made[made["impact"] == 0]
    for turn, state in enumerate(wanted):
        met = first[first["trial"] % 2 == turn]
        assert len(met) == 100
        for name, sigma in zip((*CHANNELS, "x"), next_drops.SCATTER):
            if name not in state:
                continue
            off = met[name if name in ("theta", "x") else f"{name}_pre"] - state[name]
            assert abs(off.mean()) < 5.0 * sigma / 10.0 and 0.7 * sigma < off.std() < 1.3 * sigma
    # without a place a drop begins where random ones do
    assert first.loc[first["trial"] % 2 == 0, "x"].mean() == pytest.approx(0.7 * 2.2 / 9.81, abs=0.03)


@pytest.mark.slow
def test_like_is_compared_with_like() -> None:
    """No drop tells a moving surface from a drifting camera, also where contacts take time."""
    dataset, _ = make(Case("mechanism", "plate_velocity", 0, 50, ratio=1.5))
    critique = criticise_drops(dataset, rng=generator(0, "critique", dataset.digest()))
    (step,) = critique.discovery.steps
    assert {step.effect.name, *step.alternatives} == {"moving_surface", "sensor_drift"}
    assert critique.ladder[-1][1].model.takes_time
    found = next_experiment(critique, np.random.default_rng(0))
    assert found["states"] == [] and "No release within reach would decide it" in found["why"]


def test_stored_questions_are_settled_with_half_as_many_drops() -> None:
    answers = next_drops.read_answers()
    of = answers.query("open")
    assert len(of) >= STORED
    assert of["chosen"].sum() <= 0.5 * of["random"].sum()
    assert (of["chosen"] / of["random"]).median() <= 0.5
    # in the order of the plan, none left out: nobody chose the questions
    assert [next_drops.Question(*key) for key in answers[["cause", "size", "seed"]].to_numpy()] == next_drops.plan()[
        : len(answers)
    ]
    assert f"Of {len(answers)} datasets" in next_drops.as_markdown(answers)
    _, table = draw_next_drops(answers)
    assert len(table) == len(of) and list(table["random"]) == sorted(table["random"])


@pytest.mark.slow
def test_a_stored_question_is_answered_the_same_again() -> None:
    stored = next_drops.read_answers().query("open").sort_values("random", kind="stable").iloc[0]
    again = next_drops.ask(next_drops.Question(stored["cause"], stored["size"], int(stored["seed"])))
    assert (again["effect"], again["rival"]) == (stored["effect"], stored["rival"])
    for name in ("apart", "sigmas", "random", "chosen"):
        assert again[name] == pytest.approx(stored[name], rel=NUMBERS)


def test_answers_are_kept_and_asked_once(tmp_path, monkeypatch) -> None:
    asked = []

    def answer(question: next_drops.Question) -> dict:
        asked.append(question)
        return example(question, 64.0, 16.0)

    monkeypatch.setattr("thesis_lib.studies.proof.next_drops.ask", answer)
    next_drops.run(3, lambda line: None, tmp_path)
    assert asked == next_drops.plan()[:3]
    next_drops.run(5, lambda line: None, tmp_path)
    assert asked == next_drops.plan()[:5]  # the first three are stored
    assert next_drops.read_answers(tmp_path)["random"].tolist() == [64.0] * 5


def test_shares_and_words_of_answers(tmp_path) -> None:
    nothing = dict.fromkeys(("apart", "sigmas", "random", "chosen"), "")
    next_drops.table_of(tmp_path).put(
        example(next_drops.plan()[0], 64.0, 16.0),
        example(next_drops.plan()[1], float(next_drops.STEPS[-1]), 23.0, wrong_random=1),
        example(next_drops.plan()[2], 6.0, 6.0),
        example(next_drops.plan()[3], 0.0, 0.0) | nothing | {"rival": ""},
        example(next_drops.plan()[4], 0.0, 0.0) | nothing | {"apart": 0.5},  # nothing proposed
    )
    answers = next_drops.read_answers(tmp_path)
    text = next_drops.as_markdown(answers)
    assert f"Of 5 datasets of {next_drops.FIRST} random drops, 3 cannot distinguish" in text
    assert "2 of these 3 questions" in text
    assert "The median question takes 0.25 times" in text and "wrongly settled | 23 |" in text
    assert not answers["open"].iloc[4] and np.isnan(answers["chosen"].iloc[4])
    with pytest.raises(ValueError, match="no question"):
        next_drops.as_markdown(answers[~answers["open"]])


def test_the_place_stands_in_the_report_where_it_matters() -> None:
    state = {"vx": 0.4, "vy": -2.0, "omega": 3.0, "theta": 0.2}
    for more in ({}, {"x": 0.125}):
        shown = str(states_table({"states": [state | more], "sigmas": [1.5], "shows": "difference"}))
        assert ("x (m)" in shown) == ("0.125" in shown) == bool(more)


@pytest.mark.parametrize("spoil", ["wear,x", "nothing", "wear,0.25,0,wear,witchcraft,1,1,1,1,0,0"])
def test_a_spoilt_table_is_refused(tmp_path, spoil: str) -> None:
    next_drops.table_of(tmp_path).put(example(next_drops.plan()[0], 1.0, 1.0))
    path = tmp_path / "next_experiment.csv"
    path.write_text(path.read_text() + spoil + "\n")
    with pytest.raises(CorruptFileError, match="delete the line"):
        next_drops.read_answers(tmp_path)
