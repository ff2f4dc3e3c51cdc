"""Effects and laws of one's own are told before they run, never run out of data, and meet the library's contracts."""

import hashlib
import json
import os
import sys
from pathlib import Path

import own_files
import pytest

from tests.critique.simulation.saved_models import model_of
from thesis_lib.contact import CANDIDATE_LAWS, LAWS
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_model import changed_code
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import FAMILIES
from thesis_lib.extensions.loading import installed, load, read_file
from thesis_lib.extensions.registry import RESERVED, additions, origin_of
from thesis_lib.foundation.errors import UserError

NAME = "slip_dependent_restitution"


def refusal(*files: Path, data: tuple[Path, ...] = ()) -> str:
    """Why files are refused; nothing may have joined the library."""
    before = dict(EFFECTS), dict(LAWS)
    with pytest.raises(UserError) as refused:
        load(files, data=data, say=lambda text: None)
    assert (dict(EFFECTS), dict(LAWS)) == before
    return str(refused.value)


def written(folder: Path, text: str, name: str = "own.py") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def package(folder: Path, name: str, version: str, points: str) -> None:
    """What an installed package that offers `points` leaves in a folder of modules."""
    written(folder / f"{name}-{version}.dist-info", points, "entry_points.txt")
    head = f"Metadata-Version: 2.1\nName: {name.replace('_', '-')}\nVersion: {version}\n"
    written(folder / f"{name}-{version}.dist-info", head, "METADATA")


def test_a_file_joins_the_library_in_its_order_with_its_origin(own_effect):
    before, sha256 = dict(EFFECTS), hashlib.sha256(own_effect.read_bytes()).hexdigest()
    told = load([own_effect], say=lambda text: None)
    assert told == [{"kind": "effect", "name": NAME, "file": "my_effects.py", "sha256": sha256}]
    assert set(EFFECTS) - set(before) == {NAME}
    order = [(FAMILIES.index(effect.family), name) for name, effect in EFFECTS.items()]
    assert order == sorted(order)
    assert str(origin_of("effect", NAME)) == "my_effects.py" and origin_of("effect", "com_offset") is None
    assert load([own_effect], say=lambda text: None) == told  # again


def test_a_file_can_hold_several_and_any_line_ends(tmp_path):
    second = own_files.EFFECT.split("EFFECT =")[0].replace("slip_dependent_restitution", "second")
    second = second.replace("SlipDependentRestitution", "Second").replace("depends on slip", "depends on it again")
    text = own_files.EFFECT.split("EFFECT =")[0] + second + "EFFECTS = [Second(), SlipDependentRestitution()]\n"
    path = tmp_path / "two.py"
    path.write_bytes(b"\xef\xbb\xbf" + (text + own_files.LAW).replace("\n", "\r\n").encode())
    told = load([path], say=lambda text: None)
    assert [(one["kind"], one["name"]) for one in told] == [("effect", "second"), ("effect", NAME), ("law", "my_law")]


def test_it_is_said_before_it_runs(tmp_path):
    said: list[str] = []
    path = written(tmp_path, "raise ValueError('it ran')\n" + own_files.EFFECT)
    with pytest.raises(UserError, match="it ran"):
        load([path], say=said.append)
    assert str(path) in said[0] and "runs now with all your rights" in said[0]


def test_the_state_of_a_file_that_is_loaded_again_replaces_the_earlier_one(own_effect):
    load([own_effect], say=lambda text: None)
    own_effect.write_text(own_files.EFFECT.replace("scale=0.05", "scale=0.07"), encoding="utf-8")
    load([own_effect], say=lambda text: None)
    assert EFFECTS[NAME].parameters[0].scale == 0.07 and len(additions()) == 1


@pytest.mark.parametrize("marker", ["dataset.yaml", "trajectories.csv", "impacts.parquet", "recording.yaml"])
def test_nothing_runs_out_of_a_folder_with_data(tmp_path, marker):
    ran = tmp_path / "ran"
    inside = written(tmp_path / "data" / "deep", f"open({str(ran)!r}, 'w')\n" + own_files.EFFECT)
    (tmp_path / "data" / marker).touch()
    (tmp_path / "link.py").symlink_to(inside)
    (tmp_path / "way").symlink_to(tmp_path / "data" / "deep")
    there = written(tmp_path / "elsewhere", own_files.EFFECT)
    (tmp_path / "data" / "out.py").symlink_to(there)
    for path in (inside, tmp_path / "link.py", tmp_path / "way" / "own.py", tmp_path / "data" / "out.py"):
        assert "Code out of a dataset never runs" in refusal(path)
    assert not ran.exists()
    assert "a folder with data" in refusal(there, data=(tmp_path / "elsewhere",))


def test_a_folder_in_which_a_command_is_started_installs_nothing(tmp_path, monkeypatch):
    package(tmp_path, "evil", "1.0", "[thesis_lib.effects]\nevil = evil_module\n")
    written(tmp_path, own_files.EFFECT, "evil_module.py")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    (found,) = installed()  # from any other folder it is a package like others
    assert found.origin.package == "evil"
    monkeypatch.chdir(tmp_path)
    assert installed() == []
    monkeypatch.chdir("/")
    (tmp_path / "impacts.csv").touch()
    assert installed() == []


def test_an_installed_package_adds_effects_and_laws_with_its_name(tmp_path, monkeypatch):
    points = "[thesis_lib.effects]\nslip = drop_effects.slip:EFFECT\n[thesis_lib.laws]\nlaw = drop_effects.law\n"
    package(tmp_path, "drop_effects", "1.2", points)
    written(tmp_path / "drop_effects", "", "__init__.py")
    written(tmp_path / "drop_effects", own_files.EFFECT, "slip.py")
    written(tmp_path / "drop_effects", own_files.LAW, "law.py")
    monkeypatch.syspath_prepend(tmp_path)
    told = load(say=lambda text: None)
    assert [(one["kind"], one["name"], one["package"], one["version"]) for one in told] == [
        ("effect", NAME, "drop-effects", "1.2"),
        ("law", "my_law", "drop-effects", "1.2"),
    ]
    assert BASES["my_law"].title == "my law" and len({one["sha256"] for one in told}) == 1
    assert "python -m pip install drop-effects" in origin_of("law", "my_law").remedy
    (tmp_path / "drop_effects" / "slip.py").write_text("import nothing_like_it\n")
    for name in [name for name in sys.modules if name.startswith("drop_effects")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(UserError, match=r"The installed package drop-effects 1\.2 offers slip .*pip uninstall"):
        load(say=lambda text: None)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = (", "SyntaxError"),
        ("\x00", "null bytes"),
        ("import sys\nsys.exit(3)", "SystemExit: 3"),
        ("\n\nnot_there", r"NameError: name 'not_there' is not defined (own.py, line 3)"),
        ("x = 1", "binds none of EFFECT, EFFECTS, LAW and LAWS"),
        ("EFFECT = 3", "'int', not Effect"),
        (own_files.EFFECT.replace("tion()", "tion"), "create an instance with ()"),
        (own_files.EFFECT.replace("    title =", "    other ="), "SlipDependentRestitution lacks title"),
        (own_files.EFFECT.replace(f'"{NAME}"', '"wear"'), "is used by wear of the library"),
        (own_files.EFFECT.replace(f'"{NAME}"', '"../wear"'), "lower-case letters"),
        (own_files.EFFECT.replace("restitution depends on slip", "drifting camera"), "sensor_drift of the library"),
        (own_files.NO_IDENTITY, "fails a check (changes nothing at its null): coefficients with all parameters"),
        (own_files.EFFECT.replace("np.abs(contact.v_t)", "0.0"), "cannot be tested yet"),
        (own_files.LAW.replace('"my_law"', '"my_contact"'), "is reserved"),
        (own_files.LAW.replace('"mirtich"]', '"mirtich"], promises=frozenset()'), "neither promises nor breaks"),
    ],
)
def test_a_file_that_cannot_be_used_says_why(tmp_path, text, says):
    assert says in refusal(written(tmp_path, text))


def test_paths_that_are_no_programs_are_refused(tmp_path):
    assert "does not exist" in refusal(tmp_path / "gone.py")
    assert "not a Python file" in refusal(written(tmp_path, own_files.EFFECT, "own.txt"))
    assert "a name that reports could not show" in refusal(written(tmp_path, own_files.EFFECT, "o\nwn.py"))
    (tmp_path / "folder.py").mkdir()
    assert "is a folder" in refusal(tmp_path / "folder.py")
    os.mkfifo(tmp_path / "pipe.py")
    assert "a pipe or a device" in refusal(tmp_path / "pipe.py")
    assert "the limit is 1,000,000" in refusal(written(tmp_path, "#" * 1_000_001))


def test_what_was_hashed_is_what_runs_and_nothing_is_left_beside_it(own_effect):
    loaded = read_file(own_effect, say=lambda text: own_effect.write_text("EFFECT = 3"))
    assert loaded.effects[0].name == NAME
    assert [path.name for path in own_effect.parent.iterdir()] == ["my_effects.py"]


def test_what_a_file_prints_is_no_result(tmp_path, capsys):
    load([written(tmp_path, "print('hello')\n" + own_files.EFFECT)], say=lambda text: None)
    assert capsys.readouterr() == ("", "hello\n")


def test_a_law_of_ones_own_is_tried(tmp_path):
    load([written(tmp_path, own_files.LAW)], say=lambda text: None)
    from thesis_lib.critique.drops import world
    from thesis_lib.extensions.registry import added_laws

    assert added_laws() == ("my_law",) and world.added_laws is added_laws and "my_law" not in CANDIDATE_LAWS


def test_a_law_may_be_built_on_one_of_the_library(tmp_path):
    text = """from dataclasses import replace
from thesis_lib.contact import LAWS
from thesis_lib.effects import EFFECTS
LAW = replace(LAWS["mirtich"], name="own", title="own")
"""
    loaded = read_file(written(tmp_path, text), say=lambda text: None)
    assert [law.name for law in loaded.laws] == ["own"] and loaded.effects == ()


def test_names_that_mean_something_else_are_those_of_the_critique():
    assert all(RESERVED.fullmatch(name) for name in BASES if name not in CANDIDATE_LAWS)


# --- saved models ---

LIBRARY_MODEL = model_of(mu=0.15, epsilon=0.55, law="mirtich")
MODEL = LIBRARY_MODEL.model_dump(mode="json", by_alias=True) | {"effects": [NAME]}
MODEL["parameters"][f"{NAME}.h"] = {"value": -0.08, "unit": "s/m"}


def test_a_model_whose_effect_is_not_loaded_says_which_and_how_to_load_it(tmp_path, own_effect):
    path = tmp_path / "model.json"
    of_file = {"file": "my_effects.py", "sha256": "0" * 64}
    of_package = {"package": "drop-effects", "version": "1.2", "sha256": "0" * 64}
    trust = {"if you trust that file, add --effects my_effects.py": of_file, "pip install drop-effects": of_package}
    for remedy, origin in trust.items():
        path.write_text(json.dumps(MODEL | {"origins": {NAME: origin}}))
        with pytest.raises(UserError, match=f"no effect '{NAME}'; it came from .*{remedy}"):
            load_model(path)
    path.write_text(json.dumps(MODEL))
    with pytest.raises(UserError, match=f"no effect '{NAME}'.*--effects FILE.py"):
        load_model(path)
    load([own_effect], say=lambda text: None)
    assert load_model(path).effects == (NAME,)
    path.write_text(json.dumps(MODEL | {"origins": {NAME: of_file}}))
    (changed,) = changed_code(load_model(path))
    assert changed.startswith(f"{NAME} was fitted with another version of my_effects.py")


@pytest.mark.parametrize(
    "origin",
    [
        {"file": "/evil/own.py"},
        {"file": "own.py\n"},
        {"file": "own.py", "package": "drop-effects"},
        {"package": "https://example.org/evil.zip"},
        {"package": "a; rm -rf b"},
        {},
    ],
    ids=str,
)
def test_a_model_cannot_tell_a_user_to_load_something_from_anywhere(tmp_path, origin):
    path = tmp_path / "model.json"
    path.write_text(json.dumps(MODEL | {"origins": {NAME: {"sha256": "0" * 64} | origin}}))
    with pytest.raises(UserError, match="is not a model that this program wrote"):
        load_model(path)


def test_a_model_of_the_library_alone_is_written_as_ever(tmp_path):
    LIBRARY_MODEL.save(tmp_path / "model.json")
    assert "origins" not in json.loads((tmp_path / "model.json").read_text())
    assert load_model(tmp_path / "model.json") == LIBRARY_MODEL
