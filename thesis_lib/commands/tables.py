"""Print a chapter's tables as the thesis lays them out, from the results of the last run.

python -m thesis_lib tables chapter2 [--results results]
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from thesis_lib.foundation.command_line import Parser, command
from thesis_lib.foundation.errors import UserError

EXAMPLES = """\
examples:
  python -m thesis_lib tables chapter2
  python -m thesis_lib tables chapter5 --results ../study/results | less -S
"""


# title, and below it the file below the results and the columns that are printed
TABLES = """\
What contact identifies of a body's m and I (section 2.3.3)
    chapter2/identifiability: case sigma_1 sigma_2 rank not_identified
What contact tells without known force: m/I and forces over mass (section 2.3.3)
    chapter2/homogeneous: case ratio truth ratio_error force_error found
Success of the programs from random starts, no noise (sections 2.3.2 and 2.4)
    chapter2/programs: mechanism n_steps name n_starts n_success n_false_claims theta_error_max force_error_max
m/I from noisy drops (table 2.1)
    chapter2/table_2_1: shape snr method n n_failed mean_error mean_error_std std bound error_over_bound
        error_over_law_bound thesis
Forces of the rimless wheel's first three spokes (figure 2-11)
    chapter2/wheel_forces: method order n n_failed error_n_median error_n_90 error_t_median impulse_error_n_median
Forces and base parameters of arm and disk (figure 2-12)
    chapter2/arm_summary: quantity method n_trajectories n_failed error_median error_90 share_1_percent
        share_5_percent
Impulse and peak force at impact (section 2.5, figure 2-15)
    chapter2/impact_force_summary: method quantity reference unit n mean mean_error std std_stated coverage_95
        thesis_mean_error thesis_std
m/I from measured impacts (section 2.5)
    chapter2/measured_ratio: dataset variant ratio std low high published n status
Forces that the models of arm and wheel lack: hidden, found, added
    chapter2/hidden_summary: mechanism truth snr_db datasets right misfit_before misfit_after force_error_before
        force_error_after theta_error_before theta_error_after
Ensemble parameters, best and worst, measured ellipse (table 3.1)
    chapter3/planar_impact/table_3_1: variant weighting law mu mu_std epsilon epsilon_std best best_std worst
        worst_std n_train n_held_out
From which impacts table 3.1 was identified
    chapter3/planar_impact/published_first_drops: law n mu mu_published mu_random mu_random_std lower nearer
        nearer_runs n_random
Share of the outcomes that each law can predict, measured ellipse (table 3.2)
    chapter3/planar_impact/table_3_2: variant weighting law tolerance fraction fraction_std
        fraction_up_to_one n
Held-out error of laws and bounds, measured ellipse (figure 3-8)
    chapter3/planar_impact/error_summary: model mean mean_std median quantile_90 n n_failed
Learned contact models against the IRB Bound and the laws, 450 training impacts (figure 4-5)
    chapter4/planar_impact/learning_ratios: statement n value std
Training impacts until learned models have converged (figure 4-6)
    chapter4/planar_impact/learning_convergence: model n_converged n_converged_low n_converged_high n_learned
        n_learned_low n_learned_high
Named physics, then what is left to learn: ellipse
    chapter4/planar_impact/named_rungs: model n mean low high n_failed
Named physics, then what is left to learn: dice
    chapter4/planar_dice/named_rungs: model n mean low high n_failed
Thrown dice: where they come to rest (figures 4-8 and section 4.4)
    chapter4/planar_dice/dice: model quantity value std low high std_splits splits
Beliefs after the first contact: Gaussian mixture and particles
    chapter4/planar_dice/dice_first_contact: model belief quantity value std low high
Calibration of beliefs over resting positions and contacts
    chapter4/planar_dice/dice_calibration: model kind level coverage low high passes n
Movable blocks, development and test towers (section 5.4.4: 47 %)
    chapter5/movable_summary: set threshold_mm mean low high n refused
Agreement with half the time step, with the reduced tower, and with real extraction
    chapter5/fidelity: comparison quantity value n
Consecutive extractions against samples (figure 5-5 B)
    chapter5/study_curve: policy size mean low high n refused
The same towers: extractions of hma minus those of the others
    chapter5/study_paired: policy size rival rival_size difference low high n
Samples that the mixture of regressions needs for the same
    chapter5/study_needed: policy of size needed needed_low needed_high
Successes of push, extract and place (figure 5-6)
    chapter5/study_success: phase position action attempts successes share low high published
Stuck or free after five steps, without truth in learning
    chapter5/model_agreement: size set balanced_accuracy low high n_stuck n_free n_abstractions
What each abstraction looks like
    chapter5/model_abstractions: size set abstraction share force move lag drag stuck stuck_share
Experts of the mixture of regressions (section 5.7: 2 to 11)
    chapter5/model_experts_summary: quantity size value low high n
Figure 5-7 in numbers
    chapter5/model_summary: quantity value low high n
What beliefs do along held-out pushes (section 5.5.4, figure 5-8)
    chapter5/model_belief: quantity value low high n
What the controller does about blocks pushed off their centre (figure 5-9)
    chapter5/showcase_steering_summary: quantity value low high n
The No-U-Turn sampler against the filter (figure 5-8)
    chapter5/showcase_runs: case step r_hat ess divergences belief_apart state_apart
Effects that the learner has never seen
    chapter5/unseen_summary: effect p_value new_abstraction failing_abstraction relearned_samples pushes_affected
        failing_affected pushes_others failing_others
Error on other towers with the effect, before and after relearning
    chapter5/unseen_errors: effect stage group error low high n
"""


@dataclass(frozen=True)
class Shown:
    """A table to print: file below the results, title, and columns."""

    file: str
    title: str
    columns: tuple[str, ...]


CHAPTERS: dict[str, list[Shown]] = {}
for _title, _name, _columns in re.findall(r"^(\S.*)\n {4}(\S+): (.*\n(?: {8}.*\n)*)", TABLES, re.MULTILINE):
    CHAPTERS.setdefault(_name.split("/")[0], []).append(Shown(f"{_name}.csv", _title, tuple(_columns.split())))


def as_text(shown: Shown, results: Path) -> str:
    """Title, table and the meaning of its columns; UserError if the table has not been written."""
    import pandas as pd

    from thesis_lib.foundation.columns import explain
    from thesis_lib.foundation.files import read_table

    path = results / shown.file
    if not path.is_file():
        raise UserError(f"{path} does not exist yet; make it with: snakemake --cores 2 {shown.file.split('/')[0]}")
    table = read_table(path, shown.columns)[list(shown.columns)]
    meanings = explain(path.stem, shown.columns)
    with pd.option_context("display.width", 250, "display.max_colwidth", 60):
        body = table.to_string(index=False, na_rep="-", float_format=lambda value: f"{value:.4g}")
    lines = [
        f"  {row.column}{f' ({row.unit})' if row.unit not in ('', '1') else ''}: {row.meaning}"
        for row in meanings.itertuples()
    ]
    return "\n".join([shown.title, "=" * len(shown.title), "", body, "", *lines, ""])


@command
def main(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="python -m thesis_lib tables", description=(__doc__ or "").splitlines()[0], epilog=EXAMPLES)
    parser.add_argument("chapter", choices=tuple(CHAPTERS), help="whose tables")
    parser.add_argument("--results", type=Path, default=Path("results"), help="default: %(default)s")
    args = parser.parse_args(argv)
    print("\n".join(as_text(shown, args.results) for shown in CHAPTERS[args.chapter]), end="")
    return 0
