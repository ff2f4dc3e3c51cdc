"""From trajectories to impacts: detection, arc fits, noise estimate and quality tests, in this order.

Each step handles all impacts at once: sort the samples and find gaps (`samples`), mask glitches and detect (`spikes`),
fit two arcs around each hit (`arcs`), estimate the noise from their residuals (`noise`, `colour`), exclude samples that
a filter rounded (`rounding`), fit again with that noise, and test (`quality`).  Impacts that cannot be
measured are left out with a reason; the others carry a covariance.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.checks.gap_line import GapLine, gap_line, sunk
from thesis_lib.datasets.checks.known_body import ALREADY_RADIANS, contradictions, radians_as_degrees
from thesis_lib.datasets.checks.lasting_contacts import LastingContacts, lasting_contacts
from thesis_lib.datasets.flights.arcs import ArcFits, fit_arcs
from thesis_lib.datasets.flights.drag import air_in, air_sentence, breaks_lines, window_in
from thesis_lib.datasets.flights.low_pass import ARC, Corners, low_pass_of
from thesis_lib.datasets.flights.noise import (
    SIGMA_FLOOR,
    NoiseEstimate,
    estimate_spread,
    fit_straightest,
    noise_from_arcs,
    noise_warnings,
    overstated,
    with_colour,
)
from thesis_lib.datasets.flights.parabolas import bent_sentence, hits_of, parabolas
from thesis_lib.datasets.flights.rounding import (
    Kinks,
    approach,
    contact_guard,
    guard_of,
    rounding_warning,
    sampling_interval,
    sunk_and_speed,
    touch_time,
)
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import RIM, Header, unseen_spin
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.format.samples import ArcSettings, Samples, make_samples, noise_from_differences
from thesis_lib.datasets.format.validate import DatasetError, Problem
from thesis_lib.datasets.impacts.at_walls import on_floors
from thesis_lib.datasets.impacts.energy import contact_step, energy_gain, gain_sentence, step_sentence
from thesis_lib.datasets.impacts.found import ARC_COLUMNS, LEFT_OUT_COLUMNS, FoundImpacts, arc_table, ordinals
from thesis_lib.datasets.impacts.quality import assess_arcs, contact_measures, flag_physics, has_flag_text
from thesis_lib.datasets.impacts.spikes import detect, find_glitches
from thesis_lib.datasets.impacts.stays_down import landing_speeds, stays_down
from thesis_lib.datasets.samples.copies import without_copies
from thesis_lib.datasets.samples.pieces import cut_into_pieces, without_rests
from thesis_lib.datasets.samples.stamps import exposure_times
from thesis_lib.foundation.errors import UserError

_NOISIER = 1.3  # ratio of the noise in the arcs to the assumed noise, above which detection is repeated
_STANDING_OUT = 0.9  # share of the hits that remain with coloured noise, below which detection is repeated
_MOST = 0.5  # share of the used impacts; a wrong surface gives 1, measured sets stay below 0.1
_FASTEST = 5.0  # speed after an impact over the speed before it, or over the median; no impact gains a factor of 2
_SIDEWAYS = 0.4  # of gravity, one sigma in flight: beyond it the motion leaves the plane of the camera
_SLOWER = 2.0  # sigmas of table friction that must not count as a hit
_DISPLACED = 0.1  # sampling intervals; samples then change sides
_Found = tuple[Samples, np.ndarray, ArcFits, NoiseEstimate, np.ndarray, np.ndarray]


def find_impacts(dataset: Dataset, settings: ArcSettings | None = None) -> FoundImpacts:
    """Impacts of a dataset; `settings` are `ArcSettings()` if None.

    Impacts in impacts.csv are used as they are, even beside trajectories: our fits should not replace impacts measured
    by better means.  Their covariance comes from the table, else from the header's noise, else it is None.
    UserError: the dataset has neither impacts nor trajectories, or its impacts contradict its header.
    """
    dataset.require_plane("the search for impacts")
    settings = settings or ArcSettings()
    if dataset.impacts is not None and len(dataset.impacts):
        return _from_given(dataset.stated_impacts(), dataset.header, settings)
    if dataset.trajectories is None:
        raise UserError(f"{dataset.name} has neither trajectories.csv nor impacts.csv; give at least one of them.")
    table, header = dataset.trajectories, dataset.header
    trial, t, q = (table[names].to_numpy() for names in ("trial", "t", ["x", "y", "theta"]))
    detected = find_in_arrays(trial, t, q, header, settings)
    if not dataset.has_angle:
        sigma = unseen_spin(np.hypot(*detected.impacts.v_pre[:, :2].T), header)
        whence = (
            "as dataset.yaml states" if header.spin is not None else f"a rim speed of {RIM:g} times the median speed"
        )
        said = (
            f"theta is not measured: the spin before each impact is unknown and taken as 0 ± {sigma:.3g} rad/s "
            f"({whence}); effects that show in the angle or the spin alone cannot be tested."
        )
        detected = replace(detected, warnings=(*detected.warnings, said))
    # soft contacts, and contacts found once per simulation step, are not where the body touches
    touches = detected.soft is None and not detected.step
    shape, poses = header.body.shape, detected.impacts.q
    if touches and (what := radians_as_degrees(shape, poses)):
        raise DatasetError(dataset.name, [Problem("trajectories.csv", "column theta", what, ALREADY_RADIANS)])
    if touches and (wrong := contradictions(shape, header.surface.height, poses)):
        raise DatasetError(dataset.name, wrong)
    return detected


def find_in_arrays(
    trial: np.ndarray,
    t: np.ndarray,
    q: np.ndarray,
    header: Header,
    settings: ArcSettings | None = None,
    believed: np.ndarray | None = None,
) -> FoundImpacts:
    """Impacts from poses in any order: `trial` (N,), `t` (N,) in s, `q` (N, 3) in m, m, rad with θ unwrapped.

    `believed` (3,) is the header's noise, NaN where not believed; None: it is believed unless the samples show less.
    """
    settings = given = settings or ArcSettings()
    everything, copied = without_copies(make_samples(trial, t, q, header, settings))
    # pictures that were taken at a lower rate than stated may have been shown late
    clock = header.model_copy(update={"rate": None}) if copied else header
    everything, stamped = exposure_times(everything, clock, settings)
    stated, on_table = header.stated_sigma if believed is None else believed, header.gravity == 0.0
    rough = np.fmax(noise_from_differences(everything), SIGMA_FLOOR)
    if on_table:
        everything = without_rests(everything, np.fmax(stated, rough))
    air = air_in(everything, rough, header)
    bends = air is not None and breaks_lines(air, everything, rough, settings)
    if air is not None and bends:
        everything = replace(everything, air=air)
        settings = settings.model_copy(update={"max_window": window_in(air, everything, settings)})

    def search(settings: ArcSettings, least: np.ndarray) -> _Found:
        return _search(everything, header, stated, settings, least)

    samples, at, fits, noise, glitch, sigma = search(settings, np.zeros(3))
    least = np.zeros(3)
    if (noise.colour > 1.0).any():
        # jumps due to coloured noise are not hits; if nearly all hits stand out of it, the search is not repeated
        coloured = np.fmax(sigma, noise.used * np.sqrt(noise.colour))
        if len(detect(samples, header, coloured, settings, weak=True)) < _STANDING_OUT * len(at):
            least = coloured
            samples, at, fits, noise, glitch, sigma = search(settings, least)
    falls = header.surfaces is None and header.gravity > 0.0
    if step := contact_step(fits, header, settings) if falls else 0.0:
        # for a body that turns round off the surface, the touch does not give the instant
        settings = settings.model_copy(update={"touch_sigma": float(np.abs(fits.gap).max())})
        samples, at, fits, noise, glitch, sigma = search(settings, least)
    usual, rounded = settings.guard, 0.0
    # no rounding is sought for a body that leaves its plane or lands and stays, or in a simulation
    lands = np.isfinite(landing_speeds(samples, at, noise.used, header, settings)).sum() > _MOST * len(at)
    if not (step or lands) and (on_table or noise.stray[0] < _SIDEWAYS * header.gravity):
        sides = "both" if on_table else "either"
        kinks = Kinks(fits.at, fits.t, fits.v_post - fits.v_pre, fits.at_wall)
        rounded = guard_of(kinks, samples, np.fmax(noise.sigma, SIGMA_FLOOR), settings, sides)
    low_pass, lasting = None, 0.0
    if (guard := max(rounded, contact_guard(*sunk_and_speed(on_floors(fits, header), header)))) > usual:
        settings = settings.model_copy(update={"guard": guard})
        samples, at, fits, noise, glitch, sigma = search(settings, least)
    if rounded > usual:
        lasting, known = touch_time(on_floors(fits, header), header), np.fmax(noise.sigma, SIGMA_FLOOR)
        long = (fits.n_side >= ARC).all(1) & fits.converged
        corners = Corners(fits.at, fits.t, fits.q, fits.v_pre, fits.v_post, long)
        low_pass = low_pass_of(corners, samples, known, header.gravity, guard, sampling_interval(samples), lasting)
        if low_pass is not None and low_pass.moves_parabolas:
            # the filter lowered all free fall alike
            lowered = 0.5 * header.gravity * low_pass.second_moment
            everything = replace(everything, q=everything.q + [0.0, lowered, 0.0])
            samples, at, fits, noise, glitch, sigma = search(settings, least)
    noise = with_colour(noise, fits, samples, at, settings.guard, smoothed=rounded > 0.0, on_table=on_table)
    if (doubted := overstated(noise, fits, samples, at, settings.guard)).any():
        return find_in_arrays(trial, t, q, header, given, np.where(doubted, np.nan, stated))
    glitches = _reported_glitches(everything, glitch)

    if not settings.stray_acceleration:
        noise = replace(noise, stray=np.zeros(3))
    spread = settings.contact_spread
    if spread is None:
        spread = estimate_spread(fits, header.body.radius_of_gyration, sigma, noise, settings)
    noise = replace(noise, contact_spread=spread)
    fits = fit_straightest(samples, at, noise, header, settings)

    fits = on_floors(fits, header)
    reasons, details, flags, landed = assess_arcs(fits, samples, at, noise.used, header, settings)
    used, cut = reasons == "", ""
    trial_of = samples.trial[at]
    if on_table:
        pieces = cut_into_pieces(samples, at, used)
        cut, trial_of = pieces.text(), pieces.of(trial_of, samples.t[at])
        samples = replace(samples, trial=pieces.of(samples.trial, samples.t))
        glitches["trial"] = pieces.of(glitches["trial"].to_numpy(), glitches["t"].to_numpy())
    ordinal = ordinals(trial_of)
    impacts = Impacts(
        trial=trial_of[used],
        impact=ordinal[used],
        surface=fits.surface[used],
        q=fits.q[used],
        v_pre=fits.v_pre[used],
        v_post=fits.v_post[used],
        r=header.body.shape.contact_point(fits.q[used, 2]),
        k_g=header.body.radius_of_gyration,
        mass=1.0 if header.body.mass is None else header.body.mass,
        t=fits.t[used],
        cov=fits.cov[used],
        flags=flags[used],
    )
    left_out = pd.DataFrame(dict(zip(LEFT_OUT_COLUMNS, (trial_of, ordinal, fits.t, reasons, details))))
    soft, down, line = None, None, None
    if falls:
        shape, height = header.body.shape, header.surface.height
        line = None if step else gap_line(shape, fits.q[used])
        if line is None:
            gap = shape.gap(samples.q[:, 1], samples.q[:, 2], height) + sunk(shape, fits.q[used], samples.q)
        else:
            gap = line.gap(shape, samples.q)
        soft = lasting_contacts(samples, gap, noise.used[1], header.gravity)
        bounced = contact_measures(impacts)
        v_n = bounced.v_c_pre[:, 1], bounced.v_c_post[:, 1]
        landed = landed[np.isfinite(landed)]
        down = stays_down(landed, *v_n, noise.used[1], sampling_interval(samples), header.gravity)
    gain = energy_gain(impacts)
    arcs = arc_table(fits, trial_of, ordinal, used)
    variance = noise.variance(header.surfaces is not None)
    flights = parabolas(samples, hits_of(arcs), variance, settings.guard, air)
    slowed = air_sentence(air) if air is not None and bends else ""
    lifted = slowed if air is not None and air.c_l else ""
    said = (lifted, soft and soft.sentence(), gain and gain_sentence(impacts, gain, step), down and down.sentence())
    remarks = tuple(str(text) for text in said if text)
    warnings = (
        *(text for text in (copied, stamped, cut) if text),
        *([slowed] if slowed and not lifted else []),
        *(rounding_warning(guard, usual, lasting, sampling_interval(samples), low_pass) if rounded > usual else ()),
        *([bent] if (bent := bent_sentence(len(flights.bent), len(flights.bent) + len(flights.t))) else []),
        *remarks,
        *_detection_warnings(
            fits, used, reasons, flags, header, np.unique(samples.trial), step, soft, bool(remarks), line
        ),
    )
    return FoundImpacts(
        impacts=flag_physics(impacts, settings.mu_max),
        left_out=left_out[~used].reset_index(drop=True),
        arcs=arcs,
        noise=noise,
        glitches=glitches,
        samples=samples,
        parabolas=flights,
        guard=settings.guard,
        low_pass=low_pass,
        remarks=remarks,
        soft=soft,
        down=down,
        step=step,
        gain=gain,
        air=air,
        warnings=(*warnings, *noise_warnings(noise, header.stated_sigma, glitches, settings, header.gravity > 0.0)),
    )


def _search(
    everything: Samples, header: Header, stated: np.ndarray, settings: ArcSettings, least: np.ndarray
) -> _Found:
    """Samples without glitches, instants (n,), arcs, noise, mask of glitches, noise (3,) with which arcs were fitted.

    `stated` (3,) is the header's noise, NaN where it states none; hits must exceed noise of at least `least` (3,).
    """
    rough, believed = noise_from_differences(everything), stated
    for _ in range(2):
        # the larger of the two, so that an optimistic header does not turn noise into impacts
        sigma = np.fmax(np.fmax(believed, rough), SIGMA_FLOOR)
        glitch = find_glitches(everything, header.gravity, sigma, settings)
        samples = everything.select(~glitch)
        at = detect(samples, header, np.fmax(sigma, least), settings, weak=True)
        fits = fit_arcs(samples, at, sigma, header, settings)
        noise = noise_from_arcs(fits, rough, stated, header.gravity == 0.0)
        if _displaces(noise.stray, fits, samples):
            if header.gravity == 0.0:
                slowing = _SLOWER * float(np.hypot(*noise.stray[:2]))
                at = detect(samples, header, np.fmax(sigma, least), settings, slowing, weak=True)
            fits = fit_arcs(samples, at, sigma, header, settings, stray=noise.stray)
            noise = noise_from_arcs(fits, rough, stated, header.gravity == 0.0)
        unchanged = np.array_equal(noise.stated, believed, equal_nan=True)
        quiet = (noise.sigma < _NOISIER * sigma).all() or not np.isfinite(noise.sigma).all()
        if quiet and unchanged:
            break
        believed = noise.stated
        if not quiet:
            rough = noise.sigma  # a long rest, or coloured noise, hid part of it: detect again
    return samples, at, fits, noise, glitch, sigma  # pyright: ignore[reportPossiblyUnboundVariable]


def _displaces(stray: np.ndarray, fits: ArcFits, samples: Samples) -> bool:
    """Whether accelerations `stray` (3,) move the instants of impacts by a considerable part of a sampling interval.

    A line through an arc of duration T ends a T²/12 off its parabola.
    """
    if not stray.any() or not len(fits):
        return False
    interval = sampling_interval(samples)
    lasting = interval * float(np.median(fits.n_side))
    speed = float(np.median(np.linalg.norm((fits.v_post - fits.v_pre)[:, :2], axis=1)))
    return float(np.hypot(*stray[:2])) * lasting**2 / 12.0 > _DISPLACED * interval * speed


def _detection_warnings(
    fits: ArcFits,
    used: np.ndarray,
    reasons: np.ndarray,
    flags: np.ndarray,
    header: Header,
    trials: np.ndarray,
    step: float,
    soft: LastingContacts | None,
    known: bool,
    line: GapLine | None,
) -> tuple[str, ...]:
    """Sentences for the user if nothing was found, or if most impacts happen off the surface.

    `known`: a remark already explains why no impact can be used; `line`: a surface that slopes or is bent.
    """
    advice = "Check that y points up and is in m, the times, and that the records contain impacts with some flight."
    if not len(fits):
        return (f"No impact was found in {len(trials)} trials. {advice}",)
    if not used.any():
        names, counts = np.unique(reasons.astype(str), return_counts=True)
        why = ", ".join(f"{name} {count}" for name, count in zip(names, counts))
        return (f"None of the {len(fits)} impacts found can be used ({why}).{'' if known else f' {advice}'}",)
    if line is not None and not soft:
        return (f"{line.said()} {line.remedy()}",)
    off = has_flag_text(flags[used], "no_touch")
    if off.mean() <= _MOST or soft:
        return ()
    if step:
        return (step_sentence(step, approach(fits, header)[0][used]),)
    gap = float(np.median(fits.gap[used][off]))
    return (
        f"In {off.sum()} of {used.sum()} impacts the body is off the surface (no_touch; median gap {gap:+.3g} m). "
        f"Correct surface.height ({header.surface.height:g} m; {header.surface.height + gap:.4g} m would close the "
        "gap) or the shape in dataset.yaml, or y, which must refer to the body's centre of mass.",
    )


def _reported_glitches(samples: Samples, glitch: np.ndarray) -> pd.DataFrame:
    """Glitches inside a run; its first and last sample may lie beyond a hit, and are masked without a report."""
    inside = np.zeros(len(samples), bool)
    inside[1:-1] = samples.run[2:] == samples.run[:-2]
    return pd.DataFrame({"trial": samples.trial[glitch & inside], "t": samples.t[glitch & inside]})


def _from_given(given: Impacts, header: Header, settings: ArcSettings) -> FoundImpacts:
    noise, sigma = header.noise, header.stated_sigma
    speeds = (None, None) if noise is None else (noise.velocity, noise.angular_velocity)
    if given.cov is None and np.isfinite(sigma).all() and None not in speeds:
        velocity = [speeds[0], speeds[0], speeds[1]]
        diagonal = np.diag(np.array([*sigma, *velocity, *velocity], float) ** 2)
        given = replace(given, cov=np.tile(diagonal, (len(given), 1, 1)))
    # an energy gain that no noise, law or moving surface explains is not measured
    before, after = (np.linalg.norm(v * [1.0, 1.0, given.k_g], axis=1) for v in (given.v_pre, given.v_post))
    wild = after > _FASTEST * np.maximum(before, np.median(before))
    reasons = np.full(int(wild.sum()), "energy_gain", object)
    details = np.full(len(reasons), f"leaves more than {_FASTEST:g} times as fast as it came", object)
    left_out = (given.trial[wild], given.impact[wild], given.t[wild], reasons, details)
    given = given.select(~wild)
    return FoundImpacts(
        impacts=flag_physics(given, settings.mu_max),
        left_out=pd.DataFrame(dict(zip(LEFT_OUT_COLUMNS, left_out))),
        arcs=pd.DataFrame(columns=ARC_COLUMNS),
        noise=NoiseEstimate(float(sigma[0]), float(sigma[2]), sigma, sigma, "header"),
        glitches=pd.DataFrame(columns=["trial", "t"]),
    )
