"""The configuration: what is written in config/ is what the program understands, and mistakes are named."""

import json
import re
from pathlib import Path

import pytest
import yaml

from thesis_lib.contact import LAWS
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.config import SCHEMA, Config, parse_config, read_config, schema_text

ROOT = Path(__file__).resolve().parent.parent
DEFAULT = ROOT / "config" / "config.yaml"


def mistakes(values: dict) -> str:
    with pytest.raises(UserError) as caught:
        parse_config(values)
    return str(caught.value)


class TestStoredFiles:
    def test_schema_is_in_step(self):
        stored = (ROOT / SCHEMA).read_text(encoding="utf-8")
        assert stored == schema_text(), f"{SCHEMA} is out of step: run `python -m thesis_lib.thesis.config`"

    def test_schema_describes_and_closes_every_section(self):
        schema = json.loads(schema_text())
        sections = [schema, *schema["$defs"].values()]
        objects = [section for section in sections if section.get("type") == "object"]
        assert {"Chapter3", "SimulatedDrops", "Topography"} <= set(schema["$defs"])
        assert [s["title"] for s in objects if s.get("additionalProperties") is not False] == []

    def test_config_yaml_spells_the_defaults(self):
        assert read_config(DEFAULT) == Config()

    def test_the_quick_scale_is_valid_and_names_itself(self):
        config = read_config(DEFAULT, ROOT / "config" / "quick.yaml")
        assert config.scale == "quick"
        # the scale changes how much is computed, never which experiment it is
        for name in ("body", "mu", "epsilon", "noise", "rate", "gravity"):
            assert getattr(config.drops, name) == getattr(Config().drops, name)
        assert config.seed == Config().seed and config.arcs == Config().arcs

    def test_the_larger_study_of_the_tutorial_is_valid(self):
        (text,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs/tutorial_rerun.md").read_text(encoding="utf-8"), re.S)
        assert parse_config(yaml.safe_load(text)).drops.n > Config().drops.n

    @pytest.mark.parametrize("law", LAWS)
    def test_every_law_can_be_named(self, law):
        assert parse_config({"chapter3": {"topography": {"law": law}}}).chapter3.topography.law == law

    def test_an_unknown_law_is_refused_with_the_list(self):
        with pytest.raises(UserError, match="drumwright_shell"):
            parse_config({"chapter3": {"convergence": {"laws": ["newton"]}}})


class TestMistakes:
    @pytest.mark.parametrize(
        "place",
        [
            *("bootstraps", "arcs.windows"),
            *(f"chapter3.{name}" for name in ("bootstraps", "convergence.sise", "topography.point")),
            *(f"drops.{name}" for name in ("gravitation", "body.weight", "body.shape.radius", "noise.speed")),
            "drops.release.height",
        ],
    )
    def test_unknown_key_is_refused_with_its_place(self, place):
        values = json.loads(Config().model_dump_json(by_alias=True))
        section = values
        *path, key = place.split(".")
        for part in path:
            section = section[part]
        section[key] = 1
        text = mistakes(values)
        # the kind of a shape stands between `shape` and its keys
        assert f"  {place}" in text.replace("shape.ellipse.", "shape.")
        assert "1 mistake" in text

    @pytest.mark.parametrize(
        ("values", "place"),
        [
            ({"seed": -1}, "seed"),
            ({"seed": "many"}, "seed"),
            ({"scale": "huge"}, "scale"),
            ({"measured": "data"}, "measured"),
            ({"drops": {"n": 0}}, "drops.n"),
            ({"drops": {"epsilon": 1.5}}, "drops.epsilon"),
            ({"drops": {"mu": None}}, "drops.mu"),
            ({"drops": [1]}, "drops"),
            ({"drops": {"body": {"shape": {"kind": "blob"}, "radius_of_gyration": 1.0}}}, "drops.body.shape"),
            ({"drops": {"noise": {"position": -1.0}}}, "drops.noise.position"),
            ({"chapter3": {"datasets": ["../etc"]}}, "chapter3.datasets[0]"),
            ({"chapter3": {"filter": "some"}}, "chapter3.filter"),
            ({"chapter3": {"train_share": 1.0}}, "chapter3.train_share"),
            ({"chapter3": {"bootstrap": 1}}, "chapter3.bootstrap"),
            ({"chapter3": {"metric": "energy"}}, "chapter3.metric"),
            ({"chapter3": {"convergence": {"sizes": [10, 0]}}}, "chapter3.convergence.sizes[1]"),
            ({"chapter3": {"convergence": {"sizes": []}}}, "chapter3.convergence.sizes"),
            ({"chapter3": {"convergence": {"laws": []}}}, "chapter3.convergence.laws"),
            ({"chapter3": {"range_tolerances": []}}, "chapter3.range_tolerances"),
            ({"chapter3": {"topography": {"mu": [0.1]}}}, "chapter3.topography.mu"),
            ({"chapter3": {"topography": {"mu": [0.4, 0.0]}}}, "chapter3.topography.mu"),
            ({"chapter3": {"topography": {"mu": [-0.1, 0.4]}}}, "chapter3.topography.mu[0]"),
            ({"chapter3": {"topography": {"epsilon": [0.5, 0.5]}}}, "chapter3.topography.epsilon"),
            ({"chapter3": {"topography": {"epsilon": [0.5, 1.5]}}}, "chapter3.topography.epsilon[1]"),
            ({"chapter3": {"topography": {"law": "mirtch"}}}, "chapter3.topography.law"),
            ({"chapter3": {"convergence": {"laws": ["wang-mason"]}}}, "chapter3.convergence.laws"),
        ],
    )
    def test_wrong_value_is_refused_with_its_place(self, values, place):
        assert f"  {place}" in mistakes(values)

    def test_all_mistakes_are_listed_at_once_with_what_was_found(self):
        text = mistakes({"seed": -1, "drops": {"n": 0, "m": 2}})
        assert "3 mistake(s)" in text
        for part in ("seed", "-1", "drops.n", "drops.m", "config/schema.json"):
            assert part in text

    def test_messages_speak_of_yaml_and_name_files_that_exist(self):
        text = mistakes({"measured": "nowhere", "chapter3": {"convergence": {"sizes": []}}})
        assert "measured is 'nowhere', but must be a list" in text
        assert "tuple" not in text.lower()
        *_, last = text.splitlines()
        assert (ROOT / last.split()[0]).is_file() and "docs/" not in text


class TestReading:
    def write(self, folder: Path, **files: str) -> list[Path]:
        for name, text in files.items():
            (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
        return [folder / f"{name}.yaml" for name in files]

    def test_overlays_merge_section_by_section(self, tmp_path):
        paths = self.write(
            tmp_path,
            base="seed: 4\nchapter3: {bootstrap: 7, convergence: {subsets: 4, sizes: [1, 2, 3]}}",
            over="seed: 5\nchapter3: {max_impacts: 9, convergence: {sizes: [8]}}",
        )
        config = read_config(*paths)
        assert (config.seed, config.chapter3.bootstrap, config.chapter3.max_impacts) == (5, 7, 9)
        # a list is replaced, not appended to
        assert (config.chapter3.convergence.subsets, config.chapter3.convergence.sizes) == (4, (8,))

    def test_empty_file_means_the_defaults(self, tmp_path):
        assert read_config(*self.write(tmp_path, a="# nothing\n")) == Config()

    def test_numbers_survive_the_way_through_yaml(self):
        values = Config().model_dump(mode="json", by_alias=True)
        assert parse_config(yaml.safe_load(yaml.safe_dump(values))) == Config()

    def test_missing_broken_and_listlike_files(self, tmp_path):
        broken, listlike = self.write(tmp_path, broken="a: [1", listlike="- 1\n- 2\n")
        with pytest.raises(UserError, match=r"no configuration file .*none\.yaml"):
            read_config(tmp_path / "none.yaml")
        with pytest.raises(UserError, match=r"broken\.yaml is not valid YAML"):
            read_config(broken)
        with pytest.raises(UserError, match=r"listlike\.yaml must contain keys and values, found a list"):
            read_config(listlike)

    @pytest.mark.parametrize(
        ("over", "said"),
        [
            ("# mine\nsed: 2", r"over\.yaml, line 2: sed: unknown key; did you mean 'seed'\?"),
            ("drops:\n  body:\n    shape: {kind: ellipse, semi_axis: [1, 2]}", r"line 3: .*did you mean 'semi_axes'"),
            ("drops:\n  topography: {}", r"line 2: drops\.topography: unknown key; it belongs under chapter3"),
            ("drops:\n  hue: 3", r"line 2: drops\.hue: unknown key; remove it; known keys here: n, body, "),
            ("seed: 2", r"base\.yaml, line 2: drops\.n is 0, but must be 1 or more"),
            ("1: 2", r"\(.*base\.yaml \+ .*over\.yaml\) has 2 mistake(.|\n)*Keys should be strings"),
            ("drops:\n  n: many", r"over\.yaml, line 2: drops\.n is 'many', but must be a whole number"),
        ],
    )
    def test_a_mistake_has_its_file_its_line_and_a_remedy(self, tmp_path, over, said):
        paths = self.write(tmp_path, base="seed: 1\ndrops: {n: 0}", over=over)
        with pytest.raises(UserError, match=said):
            read_config(*paths)
