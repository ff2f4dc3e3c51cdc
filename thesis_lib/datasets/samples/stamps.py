"""Time stamps of arrival: rows are stamped late by the delay of the computer, while a clock triggered the pictures.

A camera takes picture k at t_0 + P k.  A log that stamps rows on arrival contains

    t_k = t_0 + P k + δ_k,     δ_k ≥ 0: milliseconds of cable, driver, scheduler; or digits that were cut off

and a body at 2 m/s is then 4 mm off its path with δ = 2 ms, along x, y and θ at once.  No physical effect does that,
nor does noise that is independent of the speed.  Flights distinguish stamps of arrival from pictures that were really
taken at these times: the motion is smooth over only one of the two sets of times.  Windows of `WINDOW` rows in which
the body is fast are fitted by parabolas over both.  If the fits over picture numbers leave far smaller squares, the
times are t_0 + P k.  A delay that is the same in all rows changes no result.

A lost picture delays all later rows by P.  Their lateness never falls below its least value again, so the minimum over
the next `AHEAD` rows counts the lost pictures.  Fewer follow the last rows of a trial, where a delay of P means a lost
picture or late rows; and the first row after a gap may be a late row from before it, and is left out.  If rows are
seldom late by P, both are lost pictures: they are counted up to the last row, and no row is left out.

| on paper | in code   | unit | shape |                                            |
|----------|-----------|------|-------|--------------------------------------------|
| P        | `period`  | s    |       | of the pictures                            |
| k        | `picture` | 1    | (N,)  | number of the picture in its trial         |
| δ        | `late`    | s    | (N,)  | of arrival, less its least value in a trial |
"""

import numpy as np

from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples, make_samples
from thesis_lib.statistics.spread import robust_std

IRREGULAR = 1e-4  # s; steps that are off a multiple of the period by less move no body by more than its noise
MANY = 0.9  # quantile of the steps that must stay below, for regular stamps
AHEAD = 12  # rows; with delays of half a period on average, all of them are late in one case of 10^5
WINDOW, STRIDE = 8, 4  # rows of a parabola, and from one to the next: most windows hold no impact
FAST = 2.0 / 3.0  # quantile of the speed from which windows are used: at rest all times fit equally
FEW = 20  # fewest windows for a decision
STRAIGHTER = 1.5  # ratio of the median squares from which the times are those of arrival
ROUNDED = 1.05  # units by which rounded stamps are late at most, with some drift of the clock
WHOLLY = 1e-3  # units by which a multiple of one may be off: digits of floats
SPAN = 16  # steps from which the period is guessed where no rate is stated
FEW_TRIALS = 5  # fewest trials for a median period and its spread
WHOLE = 0.9  # periods by which a row must be late to lie after a lost picture
SELDOM = 0.01  # share of rows later than that, below which each such row is taken to lie after a lost picture
SURELY = 4.0  # standard errors by which the fitted period must differ from the stated one to replace it


def exposure_times(samples: Samples, header: Header, settings: ArcSettings) -> tuple[Samples, str]:
    """The samples with the exposure times of their pictures, and a message on the change.

    The samples unchanged and "" if stamps are regular, or if flights are as smooth over them.
    """
    found = times_of_pictures(samples, header.rate)
    if found is None:
        return samples, ""
    sure, t, said = found
    return make_samples(samples.trial[sure], t, samples.q[sure], header, settings), said


def times_of_pictures(
    samples: Samples, rate: float | None, lengths: int = 2
) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Mask (N,) of the samples with a certain picture number, their exposure times in s, and a message.

    The first `lengths` columns of q are in m.  None if stamps are regular, or if flights are as smooth over them.
    """
    if (clock := _clock_behind(samples, rate)) is None:
        return None
    late, sure, period = clock
    known = samples.select(sure)
    t = known.t - late[sure]
    (speed, stamped), (_, taken) = (_roughness(known, times, lengths) for times in (known.t, t))
    fast = speed >= np.quantile(speed, FAST) if len(speed) else np.zeros(0, bool)
    if fast.sum() < FEW:
        return None
    ratio = float(np.median(stamped[fast]) / max(np.median(taken[fast]), 1e-300))
    if ratio < STRAIGHTER:
        return None
    clock = f"the camera's clock of {1.0 / period:.6g} Hz"
    unit, (middle, most) = _unit(samples), np.quantile(late, [0.5, 0.95])
    if most <= ROUNDED * unit:
        fault = f"are rounded to {1e3 * unit:g} ms, and deviate by up to as much from {clock}."
        remedy = "time with more digits"
    else:
        fault = (
            f"are those of arrival, not of exposure: half of the rows are more than {1e3 * middle:.2g} ms later than "
            f"{clock}, one in twenty more than {1e3 * most:.2g} ms."
        )
        remedy = "time of exposure"
    times = f"{ratio:.2g} times" if ratio < 100.0 else "over 100 times"
    beside = ""
    if left_out := int((~sure).sum()):
        beside = f"; {left_out} rows are left out: they come first after lost pictures, or late from before them"
    said = (
        f"The time stamps {fault} With times from the picture numbers the squared residuals of the flights are {times} "
        f"smaller, so these times are used{beside}. Log the {remedy}, or the picture number over the rate."
    )
    return sure, t, said


def _unit(samples: Samples) -> float:
    """The power of ten in s of which all steps within a trial are multiples; 0 if it is below `IRREGULAR`."""
    step = np.diff(samples.t)[samples.trial[1:] == samples.trial[:-1]]
    units = [0.1, 0.01, 1e-3, IRREGULAR]
    return next((one for one in units if (np.abs(step / one - np.round(step / one)) < WHOLLY).all()), 0.0)


def _clock_behind(samples: Samples, rate: float | None) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Lateness (N,) in s of the rows, mask (N,) of the rows with a certain picture number, and period of the clock in
    s; None if stamps are regular, or too few."""
    same = samples.trial[1:] == samples.trial[:-1]
    step = np.diff(samples.t)[same]
    if len(step) < FEW:
        return None
    period = 1.0 / rate if rate else _period(samples)
    off = np.abs(step - period * np.round(step / period))
    if np.quantile(off, MANY) < IRREGULAR:
        return None
    late, sure, period = _lateness(samples, period, rate, None)
    followed = np.r_[samples.run[AHEAD - 1 :] == samples.run[: 1 - AHEAD], np.zeros(AHEAD - 1, bool)]
    if np.sum(late[followed & sure] > WHOLE * period) < SELDOM * np.sum(followed & sure):
        late, sure, period = _lateness(samples, period, rate, late)
    return late, sure, period


def _lateness(
    samples: Samples, period: float, rate: float | None, seldom: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """As `_clock_behind`; `seldom`: a first estimate of the lateness (N,) if rows are seldom late by a period."""
    picture, sure = _pictures(samples, period, seldom)
    first = np.flatnonzero(np.r_[True, np.diff(samples.trial) != 0])
    n = np.diff(np.r_[first, len(samples)])
    number = np.repeat(np.arange(len(n)), n)
    found, std = _period_of_pictures(samples.t, picture, number, n)
    if np.isfinite(found) and (not rate or abs(found - period) > SURELY * std):
        period = found
    late = samples.t - period * picture
    return late - np.minimum.reduceat(late, first)[number], sure, period


def _period_of_pictures(t: np.ndarray, picture: np.ndarray, number: np.ndarray, n: np.ndarray) -> tuple[float, float]:
    """Period in s and its standard error: the median of lines through each trial, `number` (N,) with n rows.

    The median is used because pictures are miscounted in a trial that lost some near its end.
    """
    k, of_t = (a - (np.bincount(number, a) / n)[number] for a in (picture.astype(float), t))
    across = np.bincount(number, k * k)
    each = (np.bincount(number, k * of_t) / np.maximum(across, 1.0))[n > AHEAD]
    if len(each) < FEW_TRIALS:
        return np.nan, np.inf
    return float(np.median(each)), float(1.25 * robust_std(each - np.median(each)) / np.sqrt(len(each)))


def _period(samples: Samples) -> float:
    """Median step over `SPAN` rows of a trial: delays at both ends count little."""
    far = samples.trial[SPAN:] == samples.trial[:-SPAN]
    if not far.any():
        return float(np.median(np.diff(samples.t)[samples.trial[1:] == samples.trial[:-1]]))
    return float(np.median((samples.t[SPAN:] - samples.t[:-SPAN])[far])) / SPAN


def _pictures(samples: Samples, period: float, seldom: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Picture number (N,) of each row in its trial, and the mask (N,) of the certain ones; arguments of `_lateness`.

    Rows that follow the trial in the same run help to distinguish late from lost.
    """
    picture, sure = np.zeros(len(samples), int), np.ones(len(samples), bool)
    for rows in np.split(np.arange(len(samples)), np.flatnonzero(np.diff(samples.trial)) + 1):
        n, after = len(rows), np.arange(rows[-1] + 1, min(rows[-1] + AHEAD, len(samples)))
        t = samples.t[np.r_[rows, after[samples.run[after] == samples.run[rows[-1]]]]]
        lag = t - period * np.arange(len(t))
        padded = np.r_[lag, np.full(AHEAD - 1, np.inf)]
        least = np.lib.stride_tricks.sliding_window_view(padded, AHEAD).min(axis=1)[:n]
        on_time = least[0] if seldom is None else lag[0] - seldom[rows[0]] + seldom[rows[:AHEAD]].min()
        lost = np.round((least - on_time) / period).astype(int)
        if seldom is None:  # too few rows follow the last ones
            last = max(len(t) - AHEAD, 0)
            lost[last:] = lost[min(last, n - 1)]
        lost = np.maximum.accumulate(np.maximum(lost, 0))
        for behind in np.flatnonzero(np.diff(lost, prepend=0)):
            # no row comes before its picture: such rows belong before the gap, and came late
            before, i = lost[behind - 1] if behind else 0, behind
            while i < n and lag[i] - on_time < period * (before + WHOLE):
                lost[i] = before
                i += 1
            sure[rows[i : i + 1]] = seldom is not None
        picture[rows] = np.arange(n) + lost
    return picture, sure


def _roughness(samples: Samples, t: np.ndarray, lengths: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed (w,) in m/s in windows of rows, and squared residuals (w,) of parabolas, with x, y, θ scaled by spread."""
    start = np.arange(0, max(len(samples) - WINDOW + 1, 0), STRIDE)
    start = start[samples.trial[start] == samples.trial[start + WINDOW - 1]]
    rows = start[:, None] + np.arange(WINDOW)
    tau = t[rows] - t[rows].mean(axis=1, keepdims=True)
    span = np.maximum(np.abs(tau).max(axis=1, initial=0.0), 1e-9)
    u = tau / span[:, None]
    # orthonormal columns of 1, u, u²
    Q, _ = np.linalg.qr(np.stack([np.ones_like(u), u, u * u], axis=2))
    q = samples.q[rows]
    along = np.einsum("wkj,wkc->wjc", Q, q)
    squares = np.sum((q - np.einsum("wkj,wjc->wkc", Q, along)) ** 2, axis=1)
    moved = q - q.mean(axis=1, keepdims=True)
    speed = np.einsum("wk,wkc->wc", tau, moved[..., :lengths]) / np.sum(tau**2, axis=1)[:, None]
    scale = samples.q.std(axis=0) + 1e-12
    return np.linalg.norm(speed, axis=1), (squares / scale**2).sum(axis=1)
