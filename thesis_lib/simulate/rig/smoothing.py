"""Filters by which motion capture smooths poses, for recordings of different lengths.

| name                     | operation                                                                                 |
|--------------------------|-------------------------------------------------------------------------------------------|
| `moving_average`         | mean of N poses about each pose, N odd; gain |sin(π N f/f_s) / (N sin(π f/f_s))|          |
| `median`                 | median of the same number of poses about each pose, separately in each channel            |
| `butterworth`            | second-order Butterworth filter, run causally as in a tracker: its output is delayed      |
| `zero_phase_butterworth` | the same forwards and backwards (`filtfilt`): its gain is the square                      |
| `kalman_smoother`        | Rauch-Tung-Striebel smoother of constant acceleration, driven by white jerk of density q  |

All except the median have the gain 1/√2 at the cutoff f_c.  For samples with unit noise at intervals Δt, the smoother
has the gain 1/(1 + ω⁶ Δt/q); hence q = Δt ω_c⁶/(√2 − 1).  `low_pass` is the first-order filter T ẏ + y = x in
continuous time.  Ends are extended by a reflection in the end point, as in `scipy.signal.filtfilt`.

Source: Rauch, Tung and Striebel 1965, doi 10.2514/3.3166.
"""

import numpy as np

SQUARED = (np.sqrt(2.0) - 1.0) ** 0.25  # cutoff of a squared second-order Butterworth filter over that of the filter


def smoothed(poses: np.ndarray, kind: str, cutoff: float, rate: float) -> np.ndarray:
    """Smoothed poses (n, samples, c), sampled at `rate` in Hz; recordings end where a pose is NaN."""
    length = np.isfinite(poses).all(axis=2).sum(axis=1)
    if kind == "kalman_smoother":
        return _kalman_smoother(poses, length, cutoff, rate)
    out = np.full_like(poses, np.nan)
    for size in np.unique(length[length > 1]):
        rows = length == size
        out[rows, :size] = _filtered(poses[rows, :size], kind, cutoff, rate)
    return out


def _filtered(poses: np.ndarray, kind: str, cutoff: float, rate: float) -> np.ndarray:
    from scipy.signal import butter

    size = poses.shape[1]
    pad = min(size - 1, int(np.ceil(rate / cutoff)))  # within a period of the cutoff a transient decays to 1 %
    before = 2.0 * poses[:, :1] - poses[:, pad:0:-1]
    after = 2.0 * poses[:, -1:] - poses[:, -2 : -pad - 2 : -1]
    x = np.concatenate([before, poses, after], axis=1)
    if kind in ("moving_average", "median"):
        # the gain of N poses is 1/√2 at f_s 0.443 / √(N² − 1)
        n = 1 + 2 * max(1, round((np.sqrt(1.0 + (0.443 * rate / cutoff) ** 2) - 1.0) / 2.0))
        if kind == "median":
            from scipy.ndimage import median_filter

            return np.asarray(median_filter(x, (1, n, 1), mode="nearest"))[:, pad : pad + size]
        total = np.cumsum(np.pad(x, ((0, 0), (n // 2 + 1, n // 2), (0, 0)), mode="edge"), axis=1)
        y = (total[:, n:] - total[:, :-n]) / n
    else:
        both = kind == "zero_phase_butterworth"
        warped = np.tan(np.pi * cutoff / rate) / (SQUARED if both else 1.0)  # frequency of the bilinear transform
        b, a = np.asarray(butter(2, rate / np.pi * np.arctan(warped), fs=rate))
        y = _causal(b, a, x)
        if both:
            y = _causal(b, a, y[:, ::-1])[:, ::-1]
    return y[:, pad : pad + size]


def _causal(b: np.ndarray, a: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Apply the filter along the samples of x (n, samples, c), as if the first sample had been constant before."""
    from scipy.signal import lfilter  # imported late: it takes half a second

    first = x[:, :1]
    return np.asarray(lfilter(b, a, x - first, axis=1)) + first


def _kalman_smoother(poses: np.ndarray, length: np.ndarray, cutoff: float, rate: float) -> np.ndarray:
    n, size, channels = poses.shape
    h, omega = 1.0 / rate, 2.0 * np.pi * cutoff
    F = np.array([[1.0, h, h * h / 2.0], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    power = np.array([[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]])
    Q = power * h * omega**6 / (np.sqrt(2.0) - 1.0)
    P = np.diag([1.0, omega**2, omega**4]) * 1e6  # the first state is unknown
    state = np.zeros((n, 3, channels))  # drop, pose and its derivatives, channel
    state[:, 0] = poses[:, 0]
    states, spreads = [], []
    for k in range(size):
        if k:
            state, P = F @ state, F @ P @ F.T + Q
        gain = P[:, 0] / (P[0, 0] + 1.0)
        state = state + gain[:, None] * (poses[:, k] - state[:, 0])[:, None, :]
        P = P - np.outer(gain, P[0])
        P = 0.5 * (P + P.T)
        states.append(state)
        spreads.append(P)
    out = np.full_like(poses, np.nan)
    smooth = states[-1]
    for k in range(size - 1, -1, -1):
        if k < size - 1:
            back = spreads[k] @ F.T @ np.linalg.inv(F @ spreads[k] @ F.T + Q)
            smooth = states[k] + back @ (smooth - F @ states[k])
        smooth = np.where((k >= length - 1)[:, None, None], states[k], smooth)
        out[:, k] = smooth[:, 0]
    return np.where(np.isfinite(poses), out, np.nan)


def low_pass(poses: np.ndarray, times: np.ndarray, velocity: np.ndarray, constant: float) -> np.ndarray:
    """Solution y of T ẏ + y = x, T = `constant` in s, at `times` (m,) in s, where x joins the poses (n, m, 3) linearly.

    `velocity` (n, 3) is the velocity of the body before the first pose.
    """
    out = np.empty_like(poses)
    late = poses[:, 0] - constant * velocity
    out[:, 0] = late
    for k, h in enumerate(np.diff(times), start=1):
        slope = (poses[:, k] - poses[:, k - 1]) / h
        # response to the line, x − T ẋ, and a decaying remainder
        remainder = (late - poses[:, k - 1] + constant * slope) * np.exp(-h / constant)
        late = poses[:, k] - constant * slope + remainder
        out[:, k] = late
    return out
