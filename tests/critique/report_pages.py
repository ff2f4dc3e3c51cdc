"""A made-up diagnosis, the page that reports it, and what a browser would read of that page."""

import re
from html.parser import HTMLParser
from weakref import WeakKeyDictionary

from thesis_lib.critique.results.findings import Findings
from thesis_lib.figures.style import png_of
from thesis_lib.report.critique.page import report_html

VOID = {"meta", "br", "hr", "img", "link", "wbr", "input"}
LAW = {
    "name": "anitescu_potra_newton",
    "parameters": {
        "mu": {"value": 0.15, "std": 0.004, "unit": "1"},
        "epsilon": {"value": 0.6, "std": 0.004, "unit": "1"},
    },
}
DIAGNOSIS = {
    "schema": 1,
    "dataset": "my_drops",
    "n_impacts": 412,
    "n_trials": 300,
    "verdict": "effects",
    "summary": ["AP Newton lacks tangential restitution.", "Use model.json."],
    "base_model": LAW,
    "augmented_model": LAW,
    "effects": [
        {
            "name": "tangential_restitution",
            "family": "contact_law",
            "parameters": {"e_t": {"value": 0.41, "std": 0.02, "unit": "1"}},
            "gain": {"held_out_log_score_per_impact": 1.83, "interval": [1.6, 2.1], "p_value": 0.001},
            "indistinguishable_from": ["tangential_compliance"],
            "clears": True,
            "material_in": ["impact"],
            "stand_in": None,
        }
    ],
    "error": {
        **{"unit": "m/s", "base": 0.31, "augmented": 0.052, "irb_bound": 0.04, "noise_floor": 0.048},
        "irb_bound_augmented": 0.04,
        "explained_share": 0.985,
        "worst": [],
        "flight": {"unit": "sigma", "base": 3.1, "augmented": 1.02, "noise_floor": 1.0},
    },
    "rejected": [],
    "search": {"limit": None, "value": None, "tried": True},
    "remaining": {"structured": False, "channels": [], "p_value": 0.4, "depends_on": []},
    "not_testable": [{"name": "linear_drag", "why": "no trajectories"}],
    "left_out": {"share": 0.25, "reasons": {"second_hit": 100, "not_ballistic": 37}},
    "detectable": [
        {
            "name": "tangential_restitution",
            **{"smallest": {"e_t": 0.03}, "significant": {"e_t": 0.03}, "material": {"e_t": 0.01}},
            "drops_for_half": 1200,
        },
        {
            "name": "adhesion",
            **{"smallest": {"v_s": 0.02}, "significant": {"v_s": 0.002}, "material": {"v_s": 0.02}},
            "drops_for_half": None,
        },
    ],
    "next_experiment": {
        "why": "These two differ most when the body spins fast.",
        "states": [{"vx": 0.4, "vy": -1.2, "omega": 8.0, "theta": 0.3}],
    },
}
FAULT = DIAGNOSIS["effects"][0] | {
    **{"name": "mirrored_rotation", "family": "measurement", "indistinguishable_from": []},
    "parameters": {"mirrored": {"value": 1.0, "std": 0.0, "unit": "1"}},
}


class Page(HTMLParser):
    """Text, tags and headings; fails on tags that are not closed in order."""

    def __init__(self, html):
        super().__init__()
        self.open, self.tags, self.pieces, self.headings = [], [], [], []
        self.feed(html)
        self.close()
        assert self.open == []
        self.text = " ".join("".join(self.pieces).split())

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "script"} & set(self.open):
            self.pieces.append(data)

    def all(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


_IMAGES = WeakKeyDictionary()  # of figures


def page_of(made, diagnosis):
    critique, regions, found, drawn = made
    for figure, _ in drawn.values():
        if figure not in _IMAGES:
            _IMAGES[figure] = png_of(figure)
    images = {name: _IMAGES[figure] for name, (figure, _) in drawn.items()}
    return report_html(critique, Findings(diagnosis, found, regions), drawn, images)


def leave_page_out(patch):
    """Pictures and page have tests of their own, and take longer than all else that a critique saves."""
    patch.setattr("thesis_lib.figures.critique.pictures.pictures", lambda *args: {})
    patch.setattr("thesis_lib.report.critique.page.report_html", lambda *args: "<html></html>\n")


def scripts(html):
    return re.findall(r"<script([^>]*)>(.*?)</script>", html, re.S)
