"""Tables of the games of chapter 5.

Extractions differ far more between towers than between policies, so policies are compared on the same towers, block
orders and noise:

    mean ± t_{n−1} s/√n over towers;    for two policies: the same formula for the differences, tower by tower

A refused game (an unusable tower) is counted and leaves its tower out of that policy's comparisons.  `size` is the
number of samples, 0 for policies without training.

Statements of the thesis expressed as numbers, for the claims ledger (`statements_table`; sections 5.5.2 and 5.5.3):

| quantity             | value                                                                                  |
|----------------------|----------------------------------------------------------------------------------------|
| side_extraction_gain | share of extractions of side blocks that succeed, learned over exploration             |
| push_less_movable    | share of exploring pushes that succeed less the share of movable blocks, `movable`     |
| lost_in_two_ways     | share of the games that HMA loses in which the tower topples or the block is dropped   |
| toppled_without_cost | share of towers that topple if HMA ignores p(no move), less that if it does not        |
| network_loses_more   | share of games that the network loses less that of HMA, from `shown` samples on        |
| network_brings_less  | blocks by which HMA is ahead of the network in games that neither loses, the same sizes |

A game is lost if it ends before all blocks have been tried.  Differences are taken tower by tower, over all sizes.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from thesis_lib.jenga.play.game import ALL_TRIED, DROPPED, TOPPLED, Game
from thesis_lib.statistics.intervals import Z95, clustered_mean, mean_of, mean_row, student_mean, wilson

# (attempts, successes) of push, extract and place in figure 5-6
PUBLISHED = {
    "exploration": {
        "all": ((403, 172), (172, 97), (97, 85)),
        "side": ((288, 122), (122, 52), (52, 44)),
        "middle": ((115, 50), (50, 45), (45, 41)),
    },
    "learned": {
        "all": ((203, 93), (93, 82), (82, 72)),
        "side": ((133, 69), (69, 54), (54, 49)),
        "middle": ((70, 33), (33, 28), (28, 23)),
    },
}
ACTIONS = ("push", "extract", "place")
SHARE = ("attempts", "successes", "share", "std", "low", "high")


def study_tables(games: Sequence[tuple[int, Game]], shown: int) -> dict[str, pd.DataFrame]:
    """All tables of games given as (size, game): games, attempts, curve, paired, success, course, needed.

    `shown`: number of training samples of the learned policy in success, course and needed.
    """
    table, parts = games_table(games), [game.table().assign(size=size) for size, game in games if not game.refused]
    attempts = pd.concat(parts, ignore_index=True).sort_values(["policy", "size", "tower"], kind="stable")
    attempts = attempts.reset_index(drop=True)
    return {
        "games": table,
        "attempts": attempts,
        "curve": learning_curve(table),
        "paired": pd.concat([paired(table), paired(table, "hma_without_cost")], ignore_index=True),
        "success": success_table(attempts, shown),
        "course": course_table(attempts, shown),
        "needed": pd.concat([needed_samples(table, shown, policy) for policy in ("mor", "network")], ignore_index=True),
    }


def games_table(games: Sequence[tuple[int, Game]]) -> pd.DataFrame:
    """Row per (size, game): policy, size, tower, extractions, placements (NaN if refused), tried, end, refused."""
    rows = []
    for size, game in games:
        scores = (np.nan, np.nan) if game.refused else (game.extractions, game.placements)
        rows.append((game.policy, size, game.seed, *scores, len(game.attempts), game.end, int(game.refused)))
    names = ["policy", "size", "tower", "extractions", "placements", "tried", "end", "refused"]
    return pd.DataFrame(rows, columns=names).sort_values(["policy", "size", "tower"]).reset_index(drop=True)


def learning_curve(games: pd.DataFrame) -> pd.DataFrame:
    """Extractions by size (figure 5-5B): policy, size, mean, std (standard error), low, high, n, refused."""
    rows = []
    for (policy, size), part in games.groupby(["policy", "size"], sort=True):
        counts = part["extractions"].dropna().to_numpy()
        if len(counts):
            rows.append((policy, size, *mean_row(counts), int(part["refused"].sum())))
    return pd.DataFrame(rows, columns=["policy", "size", "mean", "std", "low", "high", "n", "refused"])


def _by_tower(games: pd.DataFrame) -> pd.DataFrame:
    """Table of extractions with a row per tower and a column per (policy, size)."""
    return games.pivot_table(index="tower", columns=["policy", "size"], values="extractions")


def _differences(counts: pd.DataFrame, one: tuple[str, int], other: tuple[str, int]) -> np.ndarray:
    """Extractions of `one` (policy, size) minus those of `other`, (n,), on the towers that both played."""
    both = counts[[one, other]].dropna().to_numpy()
    return both[:, 0] - both[:, 1]


def paired(games: pd.DataFrame, policy: str = "hma") -> pd.DataFrame:
    """Extractions of `policy` at each size minus those of every other policy on the same towers.

    Learning rivals are compared at the same size (MOR also at ten times the size: the thesis's claim), rivals without
    training (size 0) and PPO at every size.  Columns policy, size, rival, rival_size, difference, std (standard error),
    low, high, n.
    """
    counts, rows = _by_tower(games), []
    for size in sorted(size for name, size in counts.columns if name == policy):
        for rival, rival_size in counts.columns:
            comparable = rival_size in (0, size) or rival == "ppo" or (rival, rival_size) == ("mor", 10 * size)
            if rival == policy or not comparable:
                continue
            apart = _differences(counts, (policy, size), (rival, rival_size))
            if len(apart):
                rows.append((policy, size, rival, rival_size, *mean_row(apart)))
    names = ["policy", "size", "rival", "rival_size", "difference", "std", "low", "high", "n"]
    return pd.DataFrame(rows, columns=names)


def success_table(attempts: pd.DataFrame, size: int) -> pd.DataFrame:
    """Attempts and successes of push, extract and place (figure 5-6): exploration against hma at `size` samples.

    Columns phase, position, action, attempts, successes, share, std, low, high (Wilson, 95 %), published (share).
    """
    rows = []
    for phase, position, part in _by_phase(attempts, size):
        for i, (action, column) in enumerate(zip(ACTIONS, ("pushed", "extracted", "placed"))):
            attempted, succeeded = PUBLISHED[phase][position][i]
            rows.append((phase, position, action, *_share(part[column]), succeeded / attempted))
    return pd.DataFrame(rows, columns=["phase", "position", "action", *SHARE, "published"])


def course_table(attempts: pd.DataFrame, size: int) -> pd.DataFrame:
    """Share of pushes that reach the goal in the course of a game, for the policies of `success_table`.

    Columns phase, position, first (number of the first of at most ten blocks, from 1), attempts, successes, share, std,
    low, high.
    """
    numbered = attempts.assign(first=attempts.groupby(["policy", "size", "tower"]).cumcount() // 10 * 10 + 1)
    rows = [
        (phase, position, first, *_share(blocks["pushed"]))
        for phase, position, part in _by_phase(numbered, size)
        for first, blocks in part.groupby("first")
    ]
    return pd.DataFrame(rows, columns=["phase", "position", "first", *SHARE])


def _by_phase(attempts: pd.DataFrame, size: int) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield attempts of exploration and of hma at `size` samples: on all blocks, side blocks, middle blocks."""
    for phase, policy, own_size in (("exploration", "exploration", 0), ("learned", "hma", size)):
        of_policy = attempts[(attempts["policy"] == policy) & (attempts["size"] == own_size)]
        for position in ("all", "side", "middle"):
            yield phase, position, of_policy[(position == "all") | (of_policy["side"] == int(position == "side"))]


def _share(outcomes: pd.Series) -> tuple[int, int, float, float, float, float]:
    """Values of `SHARE` for outcomes that are 1 (success), 0 (failure) or -1 (not tried)."""
    tried = outcomes[outcomes >= 0]
    n, k = len(tried), int((tried == 1).sum())
    # standard error with one success and one failure added, so that it is never 0
    std = float(np.sqrt((k + 1) * (n - k + 1) / (n + 2) ** 3))
    return n, k, k / n if n else np.nan, std, *wilson(k, n)


def needed_samples(games: pd.DataFrame, first: int, policy: str = "mor") -> pd.DataFrame:
    """Number of samples with which `policy` matches HMA at `first` samples, with bounds from the spread over towers.

    Columns policy, of (hma), size (of hma), needed (NaN: more than were tried), needed_low, needed_high: the smallest
    size at which the paired difference hma − `policy` is at most 0 in its mean, lower end and upper end.
    """
    counts = _by_tower(games)
    sizes = sorted(size for name, size in counts.columns if name == policy)
    ends = [(size, *student_mean(_differences(counts, ("hma", first), (policy, size)))) for size in sizes]
    needed = [next((float(end[0]) for end in ends if end[column] <= 0.0), np.nan) for column in (1, 2, 3)]
    row = (policy, "hma", first, *needed)
    return pd.DataFrame([row], columns=["policy", "of", "size", "needed", "needed_low", "needed_high"])


def statements_table(games: pd.DataFrame, success: pd.DataFrame, movable: pd.Series, shown: int) -> pd.DataFrame:
    """Table of quantity, value, std (standard error, NaN for a single tower), n, as in the module's table.

    `games` and `success` are tables of the study, `shown` the number of samples of the learned policy in `success`,
    `movable` the share of movable blocks (mean, low, high: 95 %, n towers).  Quantities without games have no row.
    """
    played = games[games["refused"] == 0].assign(
        lost=lambda table: (table["end"] != ALL_TRIED).astype(float),
        toppled=lambda table: (table["end"] == TOPPLED).astype(float),
        in_two_ways=lambda table: table["end"].isin((TOPPLED, DROPPED)).astype(float),
    )
    rows = [*_of_success(success, movable), *_of_ends(played, shown), *_of_network(played, shown)]
    table = pd.DataFrame(rows, columns=["quantity", "value", "std", "n"])
    return table[np.isfinite(table["value"])].reset_index(drop=True)


def _of_success(success: pd.DataFrame, movable: pd.Series) -> list[tuple[str, float, float, int]]:
    from scipy.special import stdtrit

    by = success.set_index(["phase", "position", "action"])
    explored, learned = (by.loc[(phase, "side", "extract")] for phase in ("exploration", "learned"))
    push = by.loc[("exploration", "all", "push")]
    gain = learned["share"] / explored["share"] if explored["successes"] else np.nan
    gain_std = gain * np.hypot(learned["std"] / learned["share"], explored["std"] / explored["share"])
    half = float(stdtrit(max(movable["n"] - 1, 1), 0.975))  # half width of the interval, in standard errors
    movable_std = (movable["high"] - movable["low"]) / (2.0 * half)
    apart, apart_std = push["share"] - movable["mean"], float(np.hypot(push["std"], movable_std))
    return [
        ("side_extraction_gain", gain, gain_std, int(explored["attempts"] + learned["attempts"])),
        ("push_less_movable", apart, apart_std, int(push["attempts"])),
    ]


def _of_ends(played: pd.DataFrame, shown: int) -> list[tuple[str, float, float, int]]:
    lost = played[(played["policy"] == "hma") & (played["lost"] == 1.0)]
    share, low, high = clustered_mean(lost["in_two_ways"].to_numpy(), lost["tower"].to_numpy())
    rows = [("lost_in_two_ways", share, (high - low) / (2.0 * Z95), len(lost))]
    toppled = played.pivot_table(index="tower", columns=["policy", "size"], values="toppled")
    if {("hma", shown), ("hma_without_cost", shown)} <= set(toppled.columns):
        apart = _differences(toppled, ("hma_without_cost", shown), ("hma", shown))
        rows.append(("toppled_without_cost", *_mean(apart)))
    return rows


def _of_network(played: pd.DataFrame, shown: int) -> list[tuple[str, float, float, int]]:
    part = played[played["size"] >= shown]
    ours, network = (part[part["policy"] == name].set_index(["tower", "size"]) for name in ("hma", "network"))
    pairs = ours.merge(network, left_index=True, right_index=True, suffixes=("_hma", "_network"))
    loses = (pairs["lost_network"] - pairs["lost_hma"]).groupby("tower").mean()
    unlost = pairs[(pairs["lost_network"] == 0.0) & (pairs["lost_hma"] == 0.0)]
    less = (unlost["extractions_hma"] - unlost["extractions_network"]).groupby("tower").mean()
    return [("network_loses_more", *_mean(loses)), ("network_brings_less", *_mean(less))]


def _mean(values: np.ndarray | pd.Series) -> tuple[float, float, int]:
    """Mean over towers, standard error and number of towers; NaN without any."""
    values = np.asarray(values, float)
    return (*mean_of(values), len(values)) if len(values) else (np.nan, np.nan, 0)
