"""report.html: one page that says what diagnosis.json says, well-formed and escaped, and no network; its elements."""

import base64
import copy
import hashlib
import re
from dataclasses import replace

import numpy as np
import pytest
from report_pages import DIAGNOSIS, FAULT, Page, page_of, scripts

from thesis_lib.contact import LAWS
from thesis_lib.critique.drops.questions.where import where as all_regions
from thesis_lib.critique.drops.words import feature_text, plain_rule, reasons_listed
from thesis_lib.critique.results.tables import ladder
from thesis_lib.critique.results.titles import rung_title
from thesis_lib.figures.critique.pictures import NAMES, pictures
from thesis_lib.report.critique import effects as report_effects
from thesis_lib.report.critique import page as report_text
from thesis_lib.report.elements import amount, estimate, interval, paragraph, percent, plus_minus
from thesis_lib.report.elements import table as html_table

EVIL = "<script>alert('x')</script> & \"quotes\""


@pytest.fixture
def diagnosis():
    return copy.deepcopy(DIAGNOSIS)


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


def test_a_page_of_a_body_in_space_shows_formulas_of_space(diagnosis):
    diagnosis["effects"][0]["name"] = "wrong_gravity"
    assert "Wrong gravity (a = (0, −(g + dg)))" in report_effects.effects(diagnosis)
    assert "Wrong gravity (a = g (1 + dg/|g|))" in report_effects.effects(diagnosis | {"dimensions": 3})
    diagnosis["effects"][0]["name"] = "magnus"  # the formula of the plane holds
    assert "(a = g + k_m ω × v)" in report_effects.effects(diagnosis | {"dimensions": 3})


def test_the_page_stands_alone_and_the_browser_may_run_its_script_and_no_other(html):
    assert [attributes for attributes, _ in scripts(html)] == 2 * [' type="application/json"'] + [""]
    assert not re.search(r"(?:src|href)=\"(?!data:image/png;base64,|#)", html)
    assert "url(" not in html and "@import" not in html
    digest = base64.b64encode(hashlib.sha256(scripts(html)[-1][1].encode()).digest()).decode()
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)[1]
    assert policy.startswith(f"default-src 'none'; script-src 'sha256-{digest}';")


def test_the_page_is_in_order_and_its_parts_have_names(page, made):
    assert page.text.index("Use model.json.") < page.text.index("1. How far the laws are")
    assert page.headings[0] == 1 and page.headings.count(1) == 1
    assert max(np.diff(page.headings)) <= 1
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    links = {attrs["href"].removeprefix("#") for attrs in page.all("a")}
    assert links <= set(ids) and {"compare", "where", "which", "added"} <= links
    assert {attrs["aria-labelledby"] for attrs in page.all("section")} <= set(ids)
    images, drawn = page.all("img"), made[-1]
    assert len(images) == len(drawn) and {*NAMES} - {*drawn} == {"candidates"}
    assert all(len(attrs["alt"]) > 80 for attrs in images)
    assert all(attrs.get("scope") in ("col", "row") for attrs in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table")) > 5


@pytest.mark.parametrize(
    "text",
    [
        "412 impacts of 300 trials",
        "25 % of the detected impacts were left out (100 × second hit",
        "e_t = 0.410 [0.371, 0.449]",
        "1.83 [1.60, 2.10] nats per impact (p = 0.0010",
        "cannot distinguish it from tangential compliance",
        "linear drag",
        "second hit too near to tell apart",
        "These two differ most when the body spins fast.",
        "from 3.10 to 1.02 standard deviations",
        "e_t = 0.030",
        "e_t = 0.030evidence1200",
        "v_s = 0.020 m/sweight–",
        "doi:10.1023/A:1008292328909",
        "98 % of the way to the noise floor",
    ],
)
def test_the_page_says_what_the_diagnosis_says(page, text):
    assert text in page.text


def test_faults_of_the_measurement_come_first(made, diagnosis, page):
    assert "the measurements themselves" not in page.text
    diagnosis["effects"].insert(0, FAULT)
    html = page_of(made, diagnosis)
    text = Page(html).text
    assert 'class="verdict fault"' in html
    fault = text.index("Mirrored rotation (θ_measured = −θ, ω_measured = −ω): on.")
    assert fault < text.index("412 impacts of 300 trials are used")
    assert "The measurements look faulty: mirrored rotation; correct the camera" in text
    assert "Mirrored rotation is a fault of the measurement; see above." in text


def test_an_adequate_model_with_unknown_noise_is_told(made, diagnosis):
    diagnosis |= {"verdict": "adequate", "effects": [], "next_experiment": None, "detectable": []}
    diagnosis["error"] |= {"noise_floor": None, "explained_share": None, "flight": None, "augmented": 0.31}
    diagnosis["left_out"] = {"share": 0.0, "reasons": {}}
    text = Page(page_of(made, diagnosis)).text
    assert "No candidate passes all tests" in text
    assert "the noise floor is unknown" in text and "none was left out" in text
    assert "The next experiment" not in text and "What these data could have shown" not in text
    assert " nan" not in text.lower()


def test_scatter_beyond_noise_is_not_called_structure(made, diagnosis):
    critique, *rest = made
    strict = critique.settings.model_copy(update={"excess_scatter": 0.01})
    diagnosis["remaining"] = {"structured": True, "channels": ["impact"], "p_value": 0.4, "depends_on": []}
    diagnosis["remaining"]["restitution"] = None
    text = Page(page_of((replace(critique, settings=strict), *rest), diagnosis)).text
    assert "times the misfit from noise alone" in text and "learns no part of it" in text
    assert "Structure remains" not in text


def test_text_of_users_is_escaped(made, diagnosis):
    diagnosis["dataset"] = EVIL
    diagnosis["summary"] = [EVIL]
    diagnosis["not_testable"] = [{"name": EVIL, "why": EVIL}]
    diagnosis["left_out"]["reasons"] = {EVIL: 3}
    diagnosis["next_experiment"]["why"] = EVIL
    critique, regions, *rest = made
    regions = {**regions, "regions": [{**r, "rule": EVIL} for r in regions["regions"]]}
    plain = scripts(page_of(made, copy.deepcopy(DIAGNOSIS)))
    html = page_of((critique, regions, *rest), diagnosis)
    assert scripts(html) == plain
    assert Page(html).text.count("<script>alert('x')</script>") >= 6


def test_there_are_no_paths_or_times_on_the_page(html):
    words = re.sub(r"base64,[^\"]*", "", html)
    assert "/tmp" not in words and "/home" not in words and not re.search(r"\b20[2-9]\d-\d\d", words)


def test_a_real_critique_with_nothing_hidden_is_told(nothing_hidden, nothing_tables, diagnosis):
    regions = all_regions(nothing_hidden)
    drawn = pictures(nothing_hidden, nothing_tables, regions)
    text = Page(page_of((nothing_hidden, regions, nothing_tables, drawn), diagnosis)).text
    assert "which were used for no choice" in text


LEFT = {"structured": True, "channels": [], "p_value": 0.005, "depends_on": ["r_x", "trial"], "restitution": None}
WORST = {"augmented": 0.096, "worst": [{"trial": 17, "t": 0.3125, "error": 1.5, "unit": "m/s"}]}
OFF, SCALE = {"clears": False, "parameters": {}}, {"name": "length_scale", "family": "measurement"}
MANY = ["tangential_compliance", "adhesion", "wear", "contact_torque", "surface_tilt"]
DRIFT = "from “drifting camera”; rule that out before … 412 impacts of 300 trials are used"
# changes of the diagnosis and of its effect; what the page says then, in this order, and what not, each between " … "
TOLD = [
    (
        {"remaining": LEFT},
        {},
        "ahead of the centre of mass (r_x); number of the release (trial). … may stand in for its",
        "^",
    ),
    ({"error": WORST}, {}, "The mean held-out error is 2 times the noise floor … 170.31251.50", "^"),
    (
        {"next_experiment": {"shows": "misfit", "sigmas": [4.0]}},
        {},
        "the misfit is largest",
        "two predictions differ most",
    ),
    ({}, {"indistinguishable_from": ["sensor_drift"]}, DRIFT, "^"),
    ({}, {"indistinguishable_from": MANY}, "cannot tell which effect it is: … or 3 more would explain as much.", "^"),
    ({}, {"material_in": ["touch", "flight"]}, "misfit of the gap at impact and the flights between impacts, not", "^"),
    ({}, {}, "cannot distinguish it from tangential compliance", "What shows it"),
    # what the user switched on is no finding, and no fault
    (
        {},
        OFF,
        "Tangential restitution was switched on by you; these data do not support it.",
        "better than any other in",
    ),
    (
        {},
        OFF | SCALE,
        "Wrong length scale was switched on by you; these data do",
        "the measurements themselves … fault of",
    ),
]


@pytest.mark.parametrize(("changes", "effect", "says", "others"), TOLD)
def test_the_page_says_what_has_changed(made, diagnosis, changes, effect, says, others):
    for name, change in changes.items():
        diagnosis[name] |= change
    diagnosis["effects"][0] |= effect
    text = Page(page_of(made, diagnosis)).text
    places = [text.find(part) for part in says.split(" … ")]
    assert -1 not in places and places == sorted(places)
    assert not any(part in text for part in others.split(" … "))


@pytest.mark.parametrize(
    ("stated", "position", "angle"),
    [
        ((np.nan, np.nan, 3e-3), "estimated from the arcs", "as dataset.yaml states"),
        ((3e-4, 3e-4, np.nan), "as dataset.yaml states", "estimated from the arcs"),
    ],
)
def test_the_source_of_the_noise_is_told_for_each_channel(hidden_drops, stated, position, angle):
    o = hidden_drops.observations
    noise = replace(o.found.noise, stated=np.array(stated), source="arcs")
    seen = replace(hidden_drops, observations=replace(o, found=replace(o.found, noise=noise)))
    text = Page(report_text.data(seen, DIAGNOSIS)).text
    assert re.search(rf"mm in position \({position}\) and \S+ mrad in angle \({angle}\)", text)


def with_last(critique, **changes):
    """The critique with another fit at the end of its ladder."""
    label, fitted, judged = critique.ladder[-1]
    return replace(critique, ladder=(critique.ladder[0], (label, another(fitted, **changes), judged)))


def another(fitted, std=None, **changes):
    """The fit with some of its fields, and its standard errors, replaced."""
    changed = replace(fitted, **changes)
    vars(changed)["std"] = std or fitted.std  # computed at the first look otherwise
    return changed


def test_parameters_that_move_little_but_surely_do_not_hardly_move(hidden_drops):
    first = hidden_drops.ladder[0][1]
    last = hidden_drops.ladder[-1][1]
    std = {**last.std, "mu": 1e-4 * first.values["mu"], "epsilon": 1e-4 * first.values["epsilon"]}
    of_one_law = replace(first.model, law=last.model.law)
    sure = another(first, std={**first.std, **std}, model=of_one_law)
    critique = replace(
        hidden_drops, ladder=((hidden_drops.ladder[0][0], sure, hidden_drops.ladder[0][2]), hidden_drops.ladder[-1])
    )

    def said(mu: float, epsilon: float) -> str:
        values = {**last.values, "mu": mu * first.values["mu"], "epsilon": epsilon * first.values["epsilon"]}
        return Page(report_effects.moved(with_last(critique, values=values, std=std))).text

    assert "stay within 3 standard errors" in said(1.0, 1.0001)
    assert "By a significant amount, but less than 2.0 %, changes ε from" in said(1.0, 1.01)
    both = said(1.2, 1.01)
    assert "had compensated for missing effects change: μ from" in both and "but less than 2.0 %, changes ε" in both


def test_a_change_of_law_is_told_on_the_ladder_and_with_the_parameters(hidden_drops, diagnosis):
    last = hidden_drops.ladder[-1][1]
    other = "whittaker" if hidden_drops.discovery.base != "whittaker" else "mirtich"
    model = replace(last.model, law=LAWS[other])
    changed = with_last(hidden_drops, model=model)
    assert rung_title(changed, 1).endswith(f", law now {LAWS[other].title}")
    assert "law now" not in rung_title(
        with_last(hidden_drops, model=replace(model, law=LAWS[changed.discovery.base])), 1
    )
    text = Page(report_effects.moved(changed)).text
    assert f"With the effects {LAWS[other].title} fits better than" in text and "not compared" in text
    rungs = ladder(changed, np.random.default_rng(0))
    assert f"(law now {LAWS[other].title})" in Page(report_effects.ladder_text(changed, diagnosis, rungs)).text


@pytest.mark.parametrize(
    "remaining, says",
    [
        ({"structured": True, "elsewhere": {"trials": 3}}, "^$"),
        ({"structured": False, "elsewhere": {"trials": 3}}, "something other than the surface"),
        ({"structured": False, "elsewhere": None, "stays_down": {"speed": 0.3}}, "slow impacts do not rebound"),
        ({"structured": False, "elsewhere": None, "stays_down": None}, "contradicts the known properties"),
    ],
)
def test_the_verdict_names_its_reason_where_no_structure_remains(remaining, says):
    d = {"verdict": "unexplained", "effects": [{"clears": True}], "remaining": remaining}
    assert re.search(says, report_text.verdict_line(d))


def test_rows_head_their_table_and_no_rows_give_no_table():
    page = Page(html_table("c & d", ("a", "b"), [("x", "1 < 2")], numeric=(1,)))
    assert "c & d" in page.text and "1 < 2" in page.text
    assert [attrs["scope"] for attrs in page.all("th")] == ["col", "col", "row"]
    assert html_table("c", ("a",), []) == ""


def test_numbers_show_their_uncertainty():
    assert estimate(0.2496, 0.0023) == "0.2496 [0.2451, 0.2541]"
    assert estimate(0.11994, 3e-5) == "0.11994 [0.11988, 0.12000]"
    assert estimate(1.0, 0.0, "rad") == "1.00 rad"
    assert estimate(4.995e-4, 1.3e-6, "m") == "0.4995 [0.4970, 0.5020] mm"
    assert estimate(1.8e-6, 1.2e-6, "m") == "0.0018 [−0.0006, 0.0042] mm"
    assert amount(0.0358, "rad") == "35.8 mrad"
    assert plus_minus(0.24961, 0.00233) == "0.2496 ± 0.0046"
    assert interval(0.10859, 0.15625, "m/s") == "[0.109, 0.156] m/s"
    assert interval(float("nan"), 1.0) == ""
    assert amount(None, "m/s") == "unknown"
    assert [percent(x) for x in (0.0, 1e-5, 0.0123, 0.5, 1.0)] == ["0 %", "less than 0.1 %", "1.2 %", "50 %", "100 %"]


def test_rules_and_reasons_are_written_as_people_write_them():
    assert plain_rule({"rule": "theta < -0.5 rad and |omega| > 3 rad/s"}) == "θ < −0.5 rad and |ω| > 3 rad/s"
    counts = {"second_hit": 50, "not_ballistic": 49, "lost_frames": 1}
    said = "50 × second hit too near to tell apart; 49 × no free flight on a side (held, rolling, bad track); "
    assert reasons_listed(counts) == said + "1 for other reasons"
    assert reasons_listed({}) == ""
    assert feature_text("theta") == "body angle (theta)" and feature_text("mood") == "mood"


def test_a_number_and_its_unit_stay_on_one_line():
    assert paragraph("an error of 0.03 m/s, 3.2 % more") == "<p>an error of 0.03\u00a0m/s, 3.2\u00a0% more</p>"
    assert paragraph("in 5 minutes") == "<p>in 5 minutes</p>"
