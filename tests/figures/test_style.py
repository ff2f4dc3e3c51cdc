"""One look, explained columns, and bytes that depend on nothing but the content."""

import io
import re
import subprocess
import sys
import zlib

import matplotlib
import numpy as np
import pandas as pd
import pytest
from fontTools.subset import Options
from fontTools.ttLib import TTFont

from thesis_lib.figures.law_style import BOUND_STYLE, LAW_STYLE
from thesis_lib.figures.style import house_style, new_figure, save_figure
from thesis_lib.thesis.figures.chapter3.contact_space import GROUPS

SUFFIXES = (".png", ".pdf", ".csv")


@house_style
def drawn(slope=1.0):
    figure = new_figure(3.0, 2.0)
    ax = figure.add_subplot()
    x = np.linspace(0.0, 1.0, 20)
    ax.plot(x, slope * x, label="θ")
    ax.pcolormesh(np.outer(x, x), rasterized=True)
    ax.legend()
    return figure, pd.DataFrame({"x": x, "y": slope * x})


def saved(folder, slope=1.0):
    save_figure(*drawn(slope), folder / "figure_0_1")
    return {suffix: (folder / f"figure_0_1{suffix}").read_bytes() for suffix in SUFFIXES}


def test_other_content_gives_other_bytes(tmp_path):
    first, second = saved(tmp_path / "a"), saved(tmp_path / "b", slope=1.1)
    assert all(first[suffix] != second[suffix] for suffix in SUFFIXES)


def test_a_users_own_settings_change_nothing(tmp_path):
    first = saved(tmp_path / "a")
    with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9, "savefig.dpi": 30}):
        assert saved(tmp_path / "b") == first


def test_files_name_no_program_and_no_date(tmp_path):
    files = saved(tmp_path)
    for word in (b"Software", b"CreationDate", b"Matplotlib", b"Producer"):
        assert word not in files[".png"] and word not in files[".pdf"]


def test_fonts_are_embedded_as_outlines_without_tables_that_no_reader_uses(tmp_path):
    streams = [
        zlib.decompress(stream)
        for stream in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", saved(tmp_path)[".pdf"], re.S)
        if stream[:1] == b"x"
    ]
    fonts = [TTFont(io.BytesIO(stream)) for stream in streams if stream.startswith(b"\0\1\0\0")]
    assert fonts
    for font in fonts:
        assert "glyf" in font and not {"GDEF", "GPOS", "GSUB"} & set(font.keys())
    assert "GPOS" not in Options._drop_tables_default  # nobody else's fonts are changed


def test_nothing_but_the_three_files_is_left(tmp_path):
    saved(tmp_path)
    assert {path.suffix for path in tmp_path.iterdir()} == set(SUFFIXES)
    assert len(list(tmp_path.iterdir())) == len(SUFFIXES)


def test_a_column_without_unit_and_meaning_is_refused(tmp_path):
    figure, table = drawn()
    with pytest.raises(KeyError, match="wobble"):
        save_figure(figure, table.assign(wobble=1.0), tmp_path / "figure")
    assert not list(tmp_path.iterdir())


def test_laws_and_bounds_differ_in_colour_and_within_a_panel_also_without():
    looks = [*LAW_STYLE.values(), *BOUND_STYLE.values()]
    assert len({look.color for look in looks}) == len(looks)
    for group in GROUPS.values():
        assert len({str(LAW_STYLE[name].dash) for name in group}) == len(group)


def test_figures_do_not_need_pyplot():
    code = (
        "import sys; "
        "import thesis_lib.thesis.figures.chapter3.contact_space, thesis_lib.thesis.figures.chapter3.errors, "
        "thesis_lib.thesis.figures.chapter3.identification, thesis_lib.thesis.figures.chapter3.trajectories; "
        "print([m for m in ('matplotlib.pyplot', 'scipy', 'pydrake') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
