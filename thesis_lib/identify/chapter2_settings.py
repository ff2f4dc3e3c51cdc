"""Settings of chapter 2: mechanisms, the programs' success, Table 2.1; those of one module stay in that module."""

from typing import Annotated, Literal

from pydantic import Field

from thesis_lib.settings import Section
from thesis_lib.simulate.chapter2 import Chapter2Bodies
from thesis_lib.simulate.chapter2_scenes import SceneSettings

Mechanism = Literal["block", "ellipse", "wheel", "arm_disk"]
Length = Annotated[int, Field(ge=2)]


class Programs(Section):
    """Success of the programs of 2.3.2 on noise-free windows from random starts.

    Own choices: the thesis gives neither window lengths nor starts.
    """

    mechanisms: tuple[Mechanism, ...] = Field(("block", "ellipse", "wheel", "arm_disk"), min_length=1)
    lengths: tuple[Length, ...] = Field(
        (10, 30, 100, 300),
        min_length=1,
        description="steps of the windows; eq. 2.14 and the mode-wise program",
    )
    windows: int = Field(10, ge=1, description="windows per mechanism and length; eq. 2.14")
    starts: int = Field(5, ge=1, description="random starts per window; eq. 2.14")
    others_lengths: tuple[Length, ...] = Field(
        (10, 30),
        min_length=1,
        description="steps; eq. 2.12, 2.13 and the softened 2.14, which take far longer",
    )
    others_windows: int = Field(3, ge=1, description="windows; eq. 2.12, 2.13 and the softened 2.14")
    others_starts: int = Field(2, ge=1, description="random starts per window of those")


class Table21(Section):
    """Settings of the noise study."""

    drops: int = Field(100, ge=2, description="per shape; thesis")
    snr: tuple[float, ...] = Field((40.0, 30.0, 20.0, 10.0), min_length=1, description="dB; thesis")
    max_impacts: int = Field(3, ge=1, le=5, description="the window ends before the next; own choice")
    min_impacts: int = Field(2, ge=1, description="own choice: one alone leaves nothing to check m/I with")
    min_after: int = Field(6, ge=2, description="samples after the last impact; own choice: 30 ms")


class Chapter2(Section):
    """Contact-implicit identification, chapter 2."""

    bodies: Chapter2Bodies = Chapter2Bodies()
    scenes: SceneSettings = SceneSettings()
    programs: Programs = Programs()
    table_2_1: Table21 = Table21()
