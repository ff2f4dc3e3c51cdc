"""Do the intervals of velocities hold on recordings as rigs write them?  Errors of found impacts against the truth.

    python -m tests.datasets.written_recordings [--drops 60] [--seeds 3] [CASE ...]

prints a line per case: share of the velocities before and after impact within their 95 % interval (by component),
spread of the errors in units of their standard errors, median standard error of v_y, share of the impacts that were
found, and false ones.

Truth: the arcs before and after a contact that takes time are extrapolated to where they come nearest to each other;
the true velocities are those of the arcs there.
"""

import argparse
from dataclasses import dataclass
from functools import cache

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Noise
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, SQUARE, CompliantContact
from thesis_lib.simulate.rig.record import DropsWithTruth
from thesis_lib.simulate.rig.tracker import Tracker

NORMAL = 1.959964  # sigmas of a 95 % interval
ROOM = 0.03  # s of flight on either side of a hit that must be found
STEPS = 60  # time steps of a contact
JUMP = 0.3  # m/s in the kinetic metric of one that must be found
BODIES = {"ellipse": ELLIPSE_BODY, "square": SQUARE}


@dataclass(frozen=True)
class Case:
    """How drops are recorded: rate in Hz, tracker."""

    rate: float = 250.0
    tracker: Tracker | None = None


def _smooth(name: str, cutoff: float, rate: float = 250.0, **more: float) -> Case:
    return Case(rate, Tracker(filter=name, cutoff=cutoff, **more))


CASES = {
    "plain": Case(),
    "plain, own noise": Case(tracker=Tracker()),
    "100 Hz": Case(100.0, Tracker()),
    "500 Hz": Case(500.0, Tracker()),
    "1000 Hz": Case(1000.0, Tracker()),
    "moving average 50 Hz": _smooth("moving_average", 37.0),
    "moving average, 1000 Hz": _smooth("moving_average", 63.0, 1000.0),
    "Butterworth 60 Hz": _smooth("butterworth", 60.0),
    "Butterworth 30 Hz": _smooth("butterworth", 30.0),
    "Butterworth 100 Hz, 1000 Hz": _smooth("butterworth", 100.0, 1000.0),
    "filtfilt 60 Hz": _smooth("zero_phase_butterworth", 60.0),
    "filtfilt 30 Hz": _smooth("zero_phase_butterworth", 30.0),
    "filtfilt 50 Hz, 1000 Hz": _smooth("zero_phase_butterworth", 50.0, 1000.0),
    "Kalman smoother 60 Hz": _smooth("kalman_smoother", 60.0),
    "Kalman smoother 30 Hz": _smooth("kalman_smoother", 30.0),
    "filter of 4 pictures": Case(250.0, Tracker(frames=4, filter="butterworth", cutoff=100.0)),
    "low pass 1 ms": Case(tracker=Tracker(time_constant=1e-3)),
    "low pass 3 ms": Case(tracker=Tracker(time_constant=3e-3)),
    "dropped frames": Case(tracker=Tracker(dropped=0.05)),
    "bursts": Case(tracker=Tracker(bursts=0.5, burst_length=8)),
    "outliers": Case(tracker=Tracker(outliers=0.01)),
    "coarse digits": Case(tracker=Tracker(position_step=1e-3, angle_step=0.01)),
    "y five times noisier": Case(tracker=Tracker(noise_factors=(1.0, 5.0, 1.0))),
    "x five times noisier": Case(tracker=Tracker(noise_factors=(5.0, 1.0, 1.0))),
    "angle five times noisier": Case(tracker=Tracker(noise_factors=(1.0, 1.0, 5.0))),
    "AR(1) 4 ms": Case(tracker=Tracker(correlation_time=4e-3)),
    "AR(1) 10 ms": Case(tracker=Tracker(correlation_time=1e-2)),
    "AR(1) 30 ms": Case(tracker=Tracker(correlation_time=3e-2)),
    "AR(1) 10 ms, 1000 Hz": Case(1000.0, Tracker(correlation_time=1e-2)),
    "slow drift": Case(tracker=Tracker(wander=1.0)),
}


@dataclass(frozen=True)
class Truth:
    """True contacts (c) of drops, sorted by trial and time: arcs before and after as state at touch and at release."""

    trial: np.ndarray  # (c,)
    touch: np.ndarray  # touch, release: (c,) s
    release: np.ndarray
    q_pre: np.ndarray  # q_pre, v_pre, q_post, v_post: (c, 3) at touch and at release, m, rad and per s
    v_pre: np.ndarray
    q_post: np.ndarray
    v_post: np.ndarray


def simulated(case: Case, shape: str, contact_time: float, drops: int, seed: int) -> tuple[Dataset, Truth]:
    """Drops of a body with nothing hidden, recorded as the case says, and their true contacts."""
    return recorded(case, shape, contact_time, drops, seed), _truth(shape, contact_time, drops, seed)


def recorded(case: Case, shape: str, contact_time: float, drops: int, seed: int) -> Dataset:
    """The drops of `simulated` alone."""
    made = _drop(shape, contact_time, drops, seed, case.rate, RIG_NOISE, case.tracker)
    return Dataset("written", made.header, made.trajectories)


def _drop(
    shape: str, contact_time: float, drops: int, seed: int, rate: float, noise: Noise | None, tracker: Tracker | None
) -> DropsWithTruth:
    contact, rng = CompliantContact(contact_time=contact_time, steps=STEPS), np.random.default_rng(seed)
    return simulate_compliant_drops(
        BODIES[shape], PROOF_RELEASE, drops, contact=contact, rate=rate, noise=noise, tracker=tracker, rng=rng
    )


@cache
def _truth(shape: str, contact_time: float, drops: int, seed: int) -> Truth:
    """True contacts, from drops without noise: the pose at release follows from the next sample or touch."""
    exact = _drop(shape, contact_time, drops, seed, 1000.0, None, None)
    table, samples = exact.impacts, exact.trajectories
    trial, touch = table["trial"].to_numpy(), table["t"].to_numpy()
    release, v_post = touch + table["duration"].to_numpy(), table[list(V_POST)].to_numpy()
    # a key that sorts by trial and time, of all known poses in flight
    known = pd.concat([table[["trial", "t", *POSE]], samples[["trial", "t", *POSE]]]).sort_values(["trial", "t"])
    later = np.searchsorted(known["trial"] * 10.0 + known["t"], trial * 10.0 + release + 1e-9)
    inside = later < len(known)
    later = np.minimum(later, len(known) - 1)
    inside &= known["trial"].to_numpy()[later] == trial
    h = (known["t"].to_numpy()[later] - release)[:, None]
    fall = np.array([0.0, -exact.header.gravity, 0.0])
    q_post = known[list(POSE)].to_numpy()[later] - v_post * h - 0.5 * fall * h * h
    q_post[~inside] = np.nan
    return Truth(trial, touch, release, table[list(POSE)].to_numpy(), table[list(V_PRE)].to_numpy(), q_post, v_post)


@dataclass(frozen=True)
class Errors:
    """Impacts that were found against the truth."""

    z: np.ndarray  # (n, 6) errors of v_pre, v_post over their standard errors, of n used impacts
    std: np.ndarray  # (n, 6)
    used: int
    found: int  # of `there` true hits with room on both sides
    there: int
    false: int  # used ones with no true hit nearby


def errors(found: FoundImpacts, truth: Truth, header: Header, frame: float, delay: float) -> Errors:
    """Errors of the used impacts, which come `delay` (s) late; contacts belong to one if they lie between its flights.

    Samples are a `frame` (s) apart.
    """
    near = found.guard + 1e-3
    impacts, metric = found.impacts, np.array([1.0, 1.0, header.body.radius_of_gyration])
    fall = np.array([0.0, -header.gravity, 0.0])
    z, std, false = [], [], 0
    cov = np.sqrt(np.einsum("nii->ni", impacts.cov))[:, 3:]
    for i in range(len(impacts)):
        t = impacts.t[i] - delay
        rows = np.flatnonzero((truth.trial == impacts.trial[i]) & (truth.touch < t + near) & (truth.release > t - near))
        if not len(rows):
            false += 1
            continue
        first, last = rows[0], rows[-1]
        # the later arc at the touch of the first contact
        h = truth.release[last] - truth.touch[first]
        v_post = truth.v_post[last] - fall * h
        q_post = truth.q_post[last] - truth.v_post[last] * h + 0.5 * fall * h * h
        d, dv = (q_post - truth.q_pre[first]) * metric, (v_post - truth.v_pre[first]) * metric
        s = -(d @ dv) / (dv @ dv)
        error = np.r_[impacts.v_pre[i] - truth.v_pre[first], impacts.v_post[i] - v_post] - np.r_[fall, fall] * s
        if np.isfinite(error).all():
            z.append(error / cov[i])
            std.append(cov[i])
    jump = np.sqrt((((truth.v_post - truth.v_pre) * metric) ** 2).sum(1))
    wait = np.where(truth.trial[1:] == truth.trial[:-1], truth.touch[1:] - truth.release[:-1], 0.0)
    clear = np.flatnonzero((jump > JUMP) & (np.r_[1.0, wait] > ROOM) & (np.r_[wait, 0.0] > ROOM))
    arcs, at = found.arcs["trial"].to_numpy(), found.arcs["t"].to_numpy() - delay
    hit = [bool(((arcs == truth.trial[j]) & (np.abs(at - truth.touch[j]) < near + 2.0 * frame)).any()) for j in clear]
    return Errors(np.array(z).reshape(-1, 6), np.array(std).reshape(-1, 6), len(impacts), sum(hit), len(hit), false)


def delay_of(case: Case) -> float:
    """Time in s by which a slow ramp comes late."""
    if case.tracker is None:
        return 0.0
    delay = case.tracker.time_constant
    if case.tracker.filter == "butterworth":
        rate = case.rate * case.tracker.frames
        delay += np.sqrt(0.5) / (rate * np.tan(np.pi * case.tracker.cutoff / rate))
    return delay


def measure(case: Case, shape: str, contact_time: float, drops: int, seeds: int) -> tuple[list[Errors], list[str]]:
    """Errors of each seed's dataset, and what was said of those that were refused."""
    result, refused = [], []
    for seed in range(seeds):
        dataset, truth = simulated(case, shape, contact_time, drops, 900 + seed)
        try:
            found = find_impacts(dataset)
        except UserError as error:
            refused.append(str(error))
            continue
        result.append(errors(found, truth, dataset.header, 1.0 / case.rate, delay_of(case)))
    return result, refused


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", help=", ".join(CASES))
    parser.add_argument("--drops", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--shapes", nargs="+", default=["ellipse"], choices=list(BODIES))
    parser.add_argument("--contact-times", nargs="+", type=float, default=[1e-3])
    args = parser.parse_args()
    head = f"{'case':<28} {'shape':<8} {'T ms':>5} {'used':>5} {'cover %':>8} {'x y θ before, after':^38}"
    print(f"{head} {'rms z of x, y, θ':^16} {'std v_y':>8} {'found %':>8} {'false':>6}")
    for name in args.cases or CASES:
        for shape in args.shapes:
            for T in args.contact_times:
                result, refused = measure(CASES[name], shape, T, args.drops, args.seeds)
                start = f"{name:<28} {shape:<8} {1e3 * T:>5.1f}"
                if refused:
                    print(f"{start} refused {len(refused)} times: {refused[0]}", flush=True)
                if not result:
                    continue
                z, std = (np.concatenate([getattr(e, part) for e in result]) for part in ("z", "std"))
                within = np.abs(z) < NORMAL
                parts = " ".join(f"{100 * share:5.1f}" for share in within.mean(0))
                rms = " ".join(f"{np.sqrt((z[:, [c, c + 3]] ** 2).mean()):5.2f}" for c in range(3))
                found = 100.0 * sum(e.found for e in result) / max(sum(e.there for e in result), 1)
                print(
                    f"{start} {sum(e.used for e in result):>5} {100 * within.mean():>8.1f} {parts:^38} {rms:^16} "
                    f"{np.median(std[:, 1]):>8.4f} {found:>8.1f} {sum(e.false for e in result):>6}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
