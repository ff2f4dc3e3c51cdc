"""Settings of chapter 2's programs, of Table 2.1 and of the wheel."""

from typing import Annotated, Literal

from pydantic import Field

from thesis_lib.foundation.settings import Section

Mechanism = Literal["block", "ellipse", "wheel", "arm_disk"]
Length = Annotated[int, Field(ge=2)]


class Programs(Section):
    """Study of the success of the programs of 2.3.2 on noise-free windows, from random starts.

    Own choices: the thesis gives neither window lengths nor starts.
    """

    mechanisms: tuple[Mechanism, ...] = Field(("block", "ellipse", "wheel", "arm_disk"), min_length=1)
    lengths: tuple[Length, ...] = Field(
        (10, 30, 100, 300), min_length=1, description="steps of the windows; eq. 2.14 and the mode-wise program"
    )
    windows: int = Field(10, ge=1, description="windows per mechanism and length; eq. 2.14")
    starts: int = Field(5, ge=1, description="random starts per window; eq. 2.14")
    others_lengths: tuple[Length, ...] = Field(
        (10, 30), min_length=1, description="steps; eq. 2.12, 2.13 and the softened 2.14, which take far longer"
    )
    others_windows: int = Field(3, ge=1, description="windows; eq. 2.12, 2.13 and the softened 2.14")
    others_starts: int = Field(2, ge=1, description="random starts per window of these programs")


class Table21(Section):
    """Settings of the noise study, table 2.1."""

    drops: int = Field(100, ge=2, description="drops per shape; thesis")
    snr: tuple[float, ...] = Field((40.0, 30.0, 20.0, 10.0), min_length=1, description="dB; thesis")
    max_impacts: int = Field(3, ge=1, le=5, description="the window ends before the next impact; own choice")
    min_impacts: int = Field(2, ge=1, description="own choice: a single impact does not allow a check of m/I")
    min_after: int = Field(6, ge=2, description="samples after the last impact; own choice: 30 ms")


class WheelStudy(Section):
    """Settings of the figures of the wheel."""

    n: int = Field(20, ge=1, description="records; own choice, the thesis shows one")
    snr: float = Field(40.0, description="dB, the lowest noise of the thesis")
    steps: int = Field(300, ge=20, description="1.5 s; own choice: the first three spokes have lifted off")
    masses: tuple[float, ...] = Field(
        (0.1, 0.5, 2.0, 10.0), description="kg, of figure 2-10; own choice: below and above the mass of the hub alone"
    )
    mass_seconds: float = Field(4.0, gt=0, description="s, of figure 2-10; own choice: rolling becomes steady")
    mass_omega: float = Field(-1.2, lt=0, description="rad/s at the start of figure 2-10; own choice")
